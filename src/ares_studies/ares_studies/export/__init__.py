# SPDX-License-Identifier: Apache-2.0
"""A recorded flight for other tools: tables, and tracks for globes."""
