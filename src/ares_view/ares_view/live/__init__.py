# SPDX-License-Identifier: Apache-2.0
"""The live page: a flight in the browser while it happens."""
