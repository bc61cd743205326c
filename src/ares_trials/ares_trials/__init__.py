# SPDX-License-Identifier: Apache-2.0
"""Try the product: faults in flights, every input, restarts, random vehicles."""
