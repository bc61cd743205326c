# SPDX-License-Identifier: Apache-2.0
"""Tabulate the published optimum for `ares optimize`."""

from collections.abc import Mapping

from rich.table import Table

from ares_bringup.commands.optimize import plain_table
from ares_bringup.report import number
from ares_thesis.reproduce import printed


def table_4_1(ours: Mapping[str, float]) -> Table:
    """Tabulate our optimum beside Table 4.1: OTIS and the thesis' own optimization.

    Args:
        ours: jettison, burn after it and cut-off, s, and final mass, kg, by name.
    """
    table = plain_table("Table 4.1", "OTIS", "thesis", "ours")
    columns = [printed.values("table-4.1")[whose].values() for whose in ("otis", "thesis")]
    for name, *values in zip(ours, *columns, ours.values(), strict=True):
        table.add_row(name, *(number(value, 2) for value in values))
    return table
