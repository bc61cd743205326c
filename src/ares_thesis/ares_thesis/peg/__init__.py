# SPDX-License-Identifier: Apache-2.0
"""PEG as the thesis flew it: law `peg_thesis`."""
