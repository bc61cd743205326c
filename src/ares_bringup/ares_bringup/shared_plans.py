# SPDX-License-Identifier: Apache-2.0
"""Share plans between commands, and between the processes of a flight."""

import os
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from tempfile import TemporaryDirectory

from ares_bringup.bag_paths import workspace_root
from ares_models.kernel_cache import private_folder
from ares_models.writable import check_folder
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
    with ExitStack() as held:
        # without room for either each process searches itself
        with suppress(OSError):
            os.environ[SHARED_SOLUTIONS] = _usable_folder(held)
            held.callback(os.environ.pop, SHARED_SOLUTIONS, None)
        yield


def _usable_folder(held: ExitStack) -> str:
    """Return the folder of plans, or a temporary one that is removed with what is held."""
    with suppress(OSError):
        folder = plans_folder()
        check_folder(folder)
        return str(folder)
    return held.enter_context(TemporaryDirectory(prefix="ares_plans_", ignore_cleanup_errors=True))


def plans_folder() -> Path:
    """Return the folder of plans: `build/plans` of the workspace, else of the user's cache."""
    root = workspace_root()
    return root / "build" / "plans" if root else private_folder() / "plans"
