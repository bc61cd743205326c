# SPDX-License-Identifier: Apache-2.0
"""Building blocks of pages: parts of a report as plain data, templates, style, script."""
