# SPDX-License-Identifier: Apache-2.0
"""The `ares` command: a module per verb, read when the verb is asked for."""
