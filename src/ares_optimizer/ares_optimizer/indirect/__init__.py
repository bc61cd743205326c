# SPDX-License-Identifier: Apache-2.0
"""The optimum as the root of a two-point problem."""
