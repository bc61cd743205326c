# SPDX-License-Identifier: Apache-2.0
"""Launch files, node parameters and the ares command line."""

__version__ = "0.1.0"
