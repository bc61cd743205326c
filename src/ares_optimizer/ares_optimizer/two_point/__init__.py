# SPDX-License-Identifier: Apache-2.0
"""The two-point problem: what the indirect method and law `optimal` solve."""
