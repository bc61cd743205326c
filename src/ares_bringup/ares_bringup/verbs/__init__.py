# SPDX-License-Identifier: Apache-2.0
"""The verbs of the command line: their options and help, by what they are about."""
