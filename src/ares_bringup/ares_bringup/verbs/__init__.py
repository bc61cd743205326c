# SPDX-License-Identifier: Apache-2.0
"""The verbs of the command line: options and help, by subject."""
