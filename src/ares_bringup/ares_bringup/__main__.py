# SPDX-License-Identifier: Apache-2.0
"""The `ares` command and the judge's process: what runs before any slow import."""

import gc
import sys

from ares_bringup.commands.interrupts import end_at_once, leave_the_end_alone
from ares_node.entry import enter, keep_standard_streams, set_up_libraries
from ares_node.requirements import missing_middleware, unmet

EXIT_BAD_INPUT = 2
EXIT_INTERRUPTED = 130


def main() -> int:
    """Run the command line if all that it needs is installed."""
    end_at_once()
    leave_the_end_alone()
    keep_standard_streams()
    set_up_libraries()
    reason = missing_middleware() or unmet("ares_bringup")
    if reason is None:
        try:
            from ares_bringup.commands.cli import main as run
        except ImportError as error:
            reason = " ".join(str(error).split())
    if reason is not None:
        print(f"ares: {reason}", file=sys.stderr)
        return EXIT_BAD_INPUT
    status = run()
    # nothing is looked through for garbage at the very end: 0.2 s
    gc.freeze()
    return status


def judge() -> int:
    """Run the judge's node until it has spoken or a signal comes."""
    # a judge that is stopped has no good word to say
    return enter("ares_bringup", "ares_bringup.judge:JudgeNode", "judge", stopped=EXIT_INTERRUPTED)


if __name__ == "__main__":
    sys.exit(main())
