# SPDX-License-Identifier: Apache-2.0
"""Optimise ascents off line: direct, indirect and analytic solutions."""
