# SPDX-License-Identifier: Apache-2.0
"""What pages are made of: parts of a report as plain data, templates, style, script."""
