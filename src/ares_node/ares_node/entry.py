"""The first thing that a node's process runs, before any slow import.

Standard library only, so that an interrupt or a missing package ends the process with at most
one line.
"""

import gc
import importlib
import os
import signal
import sys
import warnings
from types import FrameType

EXIT_OK = 0
EXIT_CANNOT_START = 2
#: How the warnings of NumPy about arithmetic begin.
BEYOND_NUMBERS = "(overflow|invalid value|divide by zero) encountered"


def _leave(_number: int, _frame: FrameType | None) -> None:
    # nothing has begun, and imports in progress must not be unwound with a traceback
    os._exit(EXIT_OK)


def set_up_libraries() -> None:
    """Keep libraries from what is slow at each start, or no line of ours. What users set stays.

    NumPy and SciPy would start threads for matrices larger than any that is here: on two cores
    0.1 s of CPU time, on more cores more. pydantic would look for plugins in all that is
    installed: 0.03 s. NumPy would print lines of source when somebody sends numbers near the
    largest ones; what comes of such numbers is looked at where it is used.
    """
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    os.environ.setdefault("PYDANTIC_DISABLE_PLUGINS", "__all__")
    if not sys.warnoptions:
        warnings.filterwarnings("ignore", BEYOND_NUMBERS, RuntimeWarning)


def enter(package: str, node: str, name: str, extra: str = "") -> int:
    """Run one node as a process.

    Args:
        package: the package of the node; what it requires is checked first.
        node: where the node's class is, `module:class`.
        name: name of the node, with which error lines begin.
        extra: of what the package requires, checked too.

    Returns:
        The exit status, as of `ares_node.run.run_node`; 2 if something is not installed.
    """
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, _leave)
    # who has become this process may have held them back until there is somebody to take them
    signal.pthread_sigmask(signal.SIG_UNBLOCK, (signal.SIGINT, signal.SIGTERM))
    set_up_libraries()
    # nothing of what is imported is garbage: 0.05 s
    gc.disable()
    from ares_node.requirements import unmet

    reason = unmet(package, extra)
    if reason is None:
        module, _, kind = node.partition(":")
        try:
            run_node = importlib.import_module("ares_node.run").run_node
            factory = getattr(importlib.import_module(module), kind)
        except ImportError as error:
            reason = " ".join(str(error).split())
    if reason is not None:
        print(f"{name}: {reason}", file=sys.stderr, flush=True)
        return EXIT_CANNOT_START
    gc.freeze()
    gc.enable()
    status: int = run_node(factory, name=name)
    # the interpreter's own end must not be interrupted either
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, signal.SIG_IGN)
    # nothing is looked through for garbage at the very end: 0.2 s
    gc.freeze()
    return status
