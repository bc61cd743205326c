# SPDX-License-Identifier: Apache-2.0
"""Solve the two-point problem of the indirect method and of law `optimal`."""
