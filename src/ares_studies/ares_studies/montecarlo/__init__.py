# SPDX-License-Identifier: Apache-2.0
"""Campaigns of dispersed flights: flown in compiled code, stored in Parquet, judged."""
