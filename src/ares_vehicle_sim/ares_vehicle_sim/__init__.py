# SPDX-License-Identifier: Apache-2.0
"""The truth: plant, engines, navigation errors, dispersions, and their node."""
