# SPDX-License-Identifier: Apache-2.0
"""A thesis on ascent guidance: its own methods and law, its tables and figures."""
