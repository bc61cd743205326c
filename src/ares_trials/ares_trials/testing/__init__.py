# SPDX-License-Identifier: Apache-2.0
"""Help tests and benchmarks; nothing else uses this package."""
