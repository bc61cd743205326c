# SPDX-License-Identifier: Apache-2.0
"""The truth as compiled functions: plant, measurement, variation of a flight."""
