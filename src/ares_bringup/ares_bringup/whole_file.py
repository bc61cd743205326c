# SPDX-License-Identifier: Apache-2.0
"""Write files atomically, and check before the work that they can be. No ROS."""

import contextlib
import errno
import os
from collections.abc import Mapping
from pathlib import Path

from ares_bringup.commands.interrupts import note_written
from ares_bringup.options import CannotStart


def check_file(out: Path) -> None:
    """Check, before the work, that the file of `--out` can be written; leave none.

    Raises:
        CannotStart: it cannot be written; one line.
    """
    part = _partial(out)
    try:
        if out.is_dir():
            raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR))
        part.touch(exist_ok=False)
        part.unlink()
    except FileExistsError:
        # left over from a killed command, or of one that writes now
        pass
    except OSError as error:
        raise _refusal(out, error) from error


def write_whole(out: Path, content: bytes) -> None:
    """Write the file of `--out` atomically, by way of a temporary name.

    Raises:
        CannotStart: it cannot be written; one line.
    """
    _write(out, {out: content})


def write_all(folder: Path, contents: Mapping[str, bytes]) -> None:
    """Write files, by name, in the folder of `--out`; remove temporary files on failure.

    Raises:
        CannotStart: one cannot be written; one line.
    """
    _write(folder, {folder / name: content for name, content in contents.items()})


def _partial(path: Path) -> Path:
    """Return the temporary name of a file."""
    return path.with_name(f".{path.name}.partial")


def _refusal(out: Path, error: OSError) -> CannotStart:
    return CannotStart(f"--out is {str(out)!r}, which cannot be written: {error.strerror}")


def _write(out: Path, contents: Mapping[Path, bytes]) -> None:
    partial = {_partial(path): path for path in contents}
    try:
        for part, path in partial.items():
            part.write_bytes(contents[path])
        for part, path in partial.items():
            os.replace(part, path)
            note_written(str(path))
    except OSError as error:
        raise _refusal(out, error) from error
    finally:
        for part in partial:
            with contextlib.suppress(OSError):
                part.unlink()
