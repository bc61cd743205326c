# SPDX-License-Identifier: Apache-2.0
"""Run the stand-in as a process."""

import sys

from fake_nodes import main

sys.exit(main("guidance"))
