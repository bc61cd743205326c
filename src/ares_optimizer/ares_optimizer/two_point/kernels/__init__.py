# SPDX-License-Identifier: Apache-2.0
"""Hold compiled functions: costates, shooting, Newton, search."""
