# SPDX-License-Identifier: Apache-2.0
"""Share plans between commands, and between the processes of a flight."""

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory

from ares_bringup.bag_paths import workspace_root
from ares_optimizer.registry import SHARED_SOLUTIONS


@contextmanager
def shared_plans() -> Iterator[None]:
    """Let searches find the plans of earlier ones, in the folder of :func:`plans_folder`.

    Where that cannot be written, the processes of this command share a temporary one. Where
    several commands share a folder already, it is theirs.
    """
    if SHARED_SOLUTIONS in os.environ:
        yield
        return
    with _folder() as folder:
        os.environ[SHARED_SOLUTIONS] = folder
        try:
            yield
        finally:
            os.environ.pop(SHARED_SOLUTIONS, None)


def plans_folder() -> Path:
    """Return the folder of plans: `build/plans` of the workspace, else of the user's cache."""
    root = workspace_root()
    if root:
        return root / "build" / "plans"
    cache = os.environ.get("XDG_CACHE_HOME")
    return (Path(cache) if cache else Path.home() / ".cache") / "ares" / "plans"


@contextmanager
def _folder() -> Iterator[str]:
    try:
        folder = plans_folder()
        folder.mkdir(parents=True, exist_ok=True)
        writable = os.access(folder, os.W_OK | os.X_OK)
    except (OSError, RuntimeError):
        writable = False
    if writable:
        yield str(folder)
        return
    with TemporaryDirectory(prefix="ares_plans_", ignore_cleanup_errors=True) as temporary:
        yield temporary
