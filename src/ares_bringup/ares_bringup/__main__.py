"""`python -m ares_bringup` is the `ares` command."""

import sys

from ares_bringup.cli import main

if __name__ == "__main__":
    sys.exit(main())
