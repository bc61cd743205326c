# SPDX-License-Identifier: Apache-2.0
"""Hostile input, made from a seed, for everything that reads what others have written.

No input may bring a traceback to a user, hang, make a process grow, or pass for what it is not.
"""
