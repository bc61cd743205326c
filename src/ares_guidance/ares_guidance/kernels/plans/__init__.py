# SPDX-License-Identifier: Apache-2.0
"""Flight by a plan: legs, the attitude programme, the flight solved anew."""
