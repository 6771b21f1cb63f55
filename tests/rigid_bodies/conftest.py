"""What tests of robot descriptions share."""

import pytest


@pytest.fixture
def file(tmp_path):
    def write(text):
        path = tmp_path / "robot.urdf"
        path.write_bytes(text if isinstance(text, bytes) else text.encode())
        return path

    return write
