# SPDX-License-Identifier: Apache-2.0
"""Recorded flights on a page: their columns as series, the globe, the charts."""
