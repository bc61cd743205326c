# SPDX-License-Identifier: Apache-2.0
"""Ascent guidance: the laws, and the node that flies them."""
