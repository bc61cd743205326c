# SPDX-License-Identifier: Apache-2.0
"""Steering laws with finitely many parameters, optimised on exact gradients."""
