# SPDX-License-Identifier: Apache-2.0
"""Inject external faults into real flights: `ares faults`."""
