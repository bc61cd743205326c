# SPDX-License-Identifier: Apache-2.0
"""Compiled: the flight with its tangents, SQP."""
