"""`python -m ares_bringup` is the `ares` command."""

import sys

from ares_bringup.interrupts import end_at_once


def main() -> int:
    """Run the command line."""
    end_at_once()
    from ares_bringup.cli import main as run

    return run()


if __name__ == "__main__":
    sys.exit(main())
