"""Which tests an ordinary run leaves out, and how they are shared between processes."""

import pytest


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Leave out the long tests unless `-m` speaks of them, or of the stability suite."""
    if any(name in config.option.markexpr for name in ("slow", "hard")):
        return
    left_out = [item for item in items if item.get_closest_marker("slow")]
    items[:] = [item for item in items if item not in left_out]
    config.hook.pytest_deselected(items=left_out)


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config: pytest.Config, log: object) -> object:
    """Let a process without work take over what another one has not begun: tests differ a hundredfold in length."""
    from xdist.scheduler import WorkStealingScheduling

    return WorkStealingScheduling(config, log)
