# SPDX-License-Identifier: Apache-2.0
"""Prepare the workspace. Standard library only: nothing else is installed by then."""
