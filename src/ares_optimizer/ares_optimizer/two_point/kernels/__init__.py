# SPDX-License-Identifier: Apache-2.0
"""Compiled: costates, shooting, Newton, search."""
