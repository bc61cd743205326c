# SPDX-License-Identifier: Apache-2.0
"""The thesis beside our results: tables, figures, errata, as one page and one JSON file."""
