# SPDX-License-Identifier: Apache-2.0
"""Compiled guidance laws on plain records."""
