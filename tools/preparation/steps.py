# SPDX-License-Identifier: Apache-2.0
"""Do the steps of a preparation that are due."""

from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

from preparation.building import build, warm_kernels
from preparation.installing import add, check_prerequisites, make_environment
from preparation.layout import Workspace
from preparation.needs import ALL_KERNELS, EVERYTHING, FIRST_LAW
from preparation.progress import BAR, Steps, say
from preparation.running import announce, preparation_lock, remove
from preparation.stamps import is_built, kernels_wanting, missing_additions, prepared_environment

COMPILING = {True: "once, until they change: about 5 minutes", False: "once, about 2 minutes"}
#: Steps of the preparation, with their duration on an idle machine of two cores, s.
PACKAGES, ADDITIONS = "Python packages", "further packages"
BUILDING, KERNELS = "messages", "kernels"
LENGTHS = {PACKAGES: 25.0, ADDITIONS: 20.0, BUILDING: 30.0, KERNELS: 110.0}
ALL_KERNELS_LENGTH = 320.0


def prepare(
    root: Path, environ: Mapping[str, str], kernels: str, also: Sequence[str] = ()
) -> Workspace:
    """Make everything that is missing or out of date.

    Args:
        root: top of the project.
        environ: the user's environment.
        kernels: to compile: ALL_KERNELS, NO_KERNELS or the name of a law.
        also: additional lists of requirements.

    Raises:
        WorkspaceError: a prerequisite is missing, or a step failed.
    """
    workspace = prepared_environment(root, environ)
    if workspace and not steps_to_do(workspace, environ, kernels, also):
        return workspace
    with preparation_lock(root) as lock:
        # another call may have prepared it meanwhile
        workspace = prepared_environment(root, environ)
        lengths = steps_to_do(workspace, environ, kernels, also)
        if workspace and not lengths:
            return workspace
        if BUILDING in lengths:
            check_prerequisites(environ)
            remove(root / "build" / "prepare.log")
        announce(lock, lengths)
        steps = Steps(lengths)
        with BAR.over(steps):
            workspace = make(root, environ, kernels, also, lock, steps)
    left = sum(steps_to_do(workspace, environ, ALL_KERNELS, EVERYTHING).values())
    if left:
        say(
            "other verbs install or compile more when they are first used, and may need the"
            f" network; all of it now, about {left:.0f} s: ./ares prepare"
        )
    return workspace


def steps_to_do(
    workspace: Workspace | None, environ: Mapping[str, str], kernels: str, also: Sequence[str]
) -> dict[str, float]:
    """Return the steps due with their durations, s; arguments as for `prepare`."""
    due = {
        PACKAGES: not workspace,
        ADDITIONS: bool(missing_additions(workspace, also) if workspace else also),
        BUILDING: not workspace or not is_built(workspace),
        KERNELS: kernels_wanting(workspace, environ, kernels) if workspace else bool(kernels),
    }
    lengths = LENGTHS | ({KERNELS: ALL_KERNELS_LENGTH} if kernels == ALL_KERNELS else {})
    return {name: length for name, length in lengths.items() if due[name]}


def make(
    root: Path,
    environ: Mapping[str, str],
    kernels: str,
    also: Sequence[str],
    lock: int,
    steps: Steps,
) -> Workspace:
    """Do the steps that are due; arguments as for `prepare`."""
    with ThreadPoolExecutor(1) as beside:
        workspace = prepared_environment(root, environ)
        if not workspace:
            with steps.step(PACKAGES):
                workspace = make_environment(root, environ, lock)
        missing = missing_additions(workspace, also)
        if missing:
            with steps.step(ADDITIONS):
                add(missing, workspace, environ, lock)

        def compile_kernels() -> None:
            with steps.step(KERNELS):
                warm_kernels(workspace, environ, lock, kernels)

        compiling = None
        if kernels_wanting(workspace, environ, kernels):
            say(f"compiling the numeric kernels ({COMPILING[kernels == ALL_KERNELS]})")
            if kernels == FIRST_LAW or is_built(workspace):
                compiling = beside.submit(compile_kernels)
            elif kernels == ALL_KERNELS:
                # generating the messages leaves part of the machine idle
                beside.submit(warm_kernels, workspace, environ, lock, FIRST_LAW)
        if not is_built(workspace):
            with steps.step(BUILDING):
                build(workspace, environ, lock)
        if compiling is None and kernels_wanting(workspace, environ, kernels):
            compiling = beside.submit(compile_kernels)
        if compiling is not None:
            compiling.result()
    return workspace
