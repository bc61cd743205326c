# SPDX-License-Identifier: Apache-2.0
"""Common parts of all nodes of the graph."""
