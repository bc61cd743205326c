# SPDX-License-Identifier: Apache-2.0
"""Failures at every second: what a flight still reaches, and what an optimizer that knew would."""
