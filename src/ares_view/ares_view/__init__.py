# SPDX-License-Identifier: Apache-2.0
"""Flights as they happen: standard messages for other tools, a live page in the browser."""
