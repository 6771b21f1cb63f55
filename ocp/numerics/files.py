"""Files that appear whole or not at all."""

from __future__ import annotations

import contextlib
import uuid
from collections.abc import Iterator
from pathlib import Path


@contextlib.contextmanager
def written_whole(path: Path) -> Iterator[Path]:
    """Yield the path of a new file beside `path`, and let it take the place of `path` when the block is left.

    If the block raises, the new file is removed and what stood at `path` before stays.

    Args:
        path: of the file; the new one has the same suffix.

    Raises:
        OSError: the folder cannot be written to.
    """
    part = path.with_name(f"{path.stem}.{uuid.uuid4().hex[:8]}.part{path.suffix}")
    try:
        yield part
        part.replace(path)
    finally:
        part.unlink(missing_ok=True)
