# SPDX-License-Identifier: Apache-2.0
"""Every value that a schema allows or forbids, tried: flown, solved, or refused in one line."""
