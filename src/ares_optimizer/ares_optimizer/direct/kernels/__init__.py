# SPDX-License-Identifier: Apache-2.0
"""Hold compiled functions: the flight with its tangents, SQP."""
