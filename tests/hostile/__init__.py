# SPDX-License-Identifier: Apache-2.0
"""Hostile input, generated from a seed, for every reader of foreign data.

No input may bring a traceback to a user, hang, make a process grow, or pass for what it is not.
"""
