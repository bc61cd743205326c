# SPDX-License-Identifier: Apache-2.0
"""Hold compiled functions: samples of a flight, comparison with the closed form."""
