# SPDX-License-Identifier: Apache-2.0
"""Try every value that a schema allows or forbids: fly it, solve it, or refuse it in one line."""
