# SPDX-License-Identifier: Apache-2.0
"""Collocation: one sparse program for every mission that a file can state."""
