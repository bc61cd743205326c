# SPDX-License-Identifier: Apache-2.0
"""Optimise ascents off line: direct and indirect solutions."""
