# SPDX-License-Identifier: Apache-2.0
"""The off-line optimizer: direct, indirect and analytic solutions of the ascent."""
