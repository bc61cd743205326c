# SPDX-License-Identifier: Apache-2.0
"""The off-line optimizer: direct and indirect solutions of the ascent."""
