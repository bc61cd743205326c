# SPDX-License-Identifier: Apache-2.0
"""Start the `ares` command or the judge, without any slow import."""

import gc
import sys

from ares_bringup.commands.interrupts import end_at_once, leave_the_end_alone
from ares_node.entry import enter, keep_standard_streams, set_up_libraries
from ares_node.requirements import missing_middleware, unmet

EXIT_BAD_INPUT = 2
EXIT_INTERRUPTED = 130


def main() -> int:
    """Run the command line if everything it needs is installed."""
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
    # saves 0.2 s: no final garbage collection
    gc.freeze()
    return status


def judge() -> int:
    """Run the judge's node until it has given its verdict or a signal comes."""
    # a judge that is stopped must not exit with the status of a good flight
    return enter("ares_bringup", "ares_bringup.judge:JudgeNode", "judge", stopped=EXIT_INTERRUPTED)


if __name__ == "__main__":
    sys.exit(main())
