"""Which tests an ordinary run leaves out."""

import pytest


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Leave out the long cases of the stability suite unless `-m` speaks of hard cases."""
    if "hard" in config.option.markexpr:
        return
    left_out = [item for item in items if item.get_closest_marker("hard") and item.get_closest_marker("slow")]
    items[:] = [item for item in items if item not in left_out]
    config.hook.pytest_deselected(items=left_out)
