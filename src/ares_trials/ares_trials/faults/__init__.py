# SPDX-License-Identifier: Apache-2.0
"""Faults from outside into real flights: `ares faults`."""
