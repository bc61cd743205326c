# SPDX-License-Identifier: Apache-2.0
"""Hold compiled functions: burns as polynomials and their iteration."""
