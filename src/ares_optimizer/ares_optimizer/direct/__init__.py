# SPDX-License-Identifier: Apache-2.0
"""Optimise steering laws with finitely many parameters on exact gradients."""
