# SPDX-License-Identifier: Apache-2.0
"""Compiled: polynomial burns and their iteration."""
