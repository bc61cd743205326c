# SPDX-License-Identifier: Apache-2.0
"""The verbs of the `ares` command: one module each, imported on demand."""
