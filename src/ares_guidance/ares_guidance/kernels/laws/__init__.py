# SPDX-License-Identifier: Apache-2.0
"""Steering laws, and the search that iterates them to convergence."""
