# SPDX-License-Identifier: Apache-2.0
"""Verify solutions by a flight with physics written a second time."""
