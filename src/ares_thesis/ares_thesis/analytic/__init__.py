# SPDX-License-Identifier: Apache-2.0
"""Chapter 5 of the thesis."""
