# SPDX-License-Identifier: Apache-2.0
"""The flight again, by physics written a second time."""
