"""Files that are there whole, or not at all. No ROS."""

import contextlib
import os
from pathlib import Path

from ares_bringup.options import CannotStart


def write_whole(out: Path, content: bytes) -> None:
    """Write what `--out` names: under another name first.

    Raises:
        CannotStart: it cannot be written; one line.
    """
    partial = out.with_name(f".{out.name}.partial")
    try:
        partial.write_bytes(content)
        os.replace(partial, out)
    except OSError as error:
        raise CannotStart(
            f"--out is {str(out)!r}, which cannot be written: {error.strerror}"
        ) from error
    finally:
        with contextlib.suppress(OSError):
            partial.unlink()
