# SPDX-License-Identifier: Apache-2.0
"""Aids of tests and benchmarks; nothing else uses them."""
