# SPDX-License-Identifier: Apache-2.0
"""Prediction of the burn ahead."""
