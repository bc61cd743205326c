# SPDX-License-Identifier: Apache-2.0
"""Table and figures of where pieces come down, for a campaign's page."""

import numpy as np

from ares_studies.montecarlo.footprints import SHARE, Footprint
from ares_studies.montecarlo.statistics import Summary
from ares_studies.montecarlo.table import FALLEN
from ares_studies.pages.parts import (
    Axis,
    Column,
    Figure,
    Item,
    PageTable,
    Role,
    Row,
    Series,
    Shape,
    capitalised,
    item,
    number,
    unbroken,
)

#: Most points of a scatter plot.
CLOUD = 3000

TEXT = (
    "Each flight's pieces fall through its own air and wind, as points with the drag drawn for "
    f"them. An ellipse holds {100 * SHARE:g} % of the places if they are normal in two components."
)


def footprint_items(summary: Summary) -> list[Item]:
    """Make the table of all footprints and a figure of each; none without any."""
    if not summary.footprints:
        return []
    return [_table(summary), *(_figure(summary, footprint) for footprint in summary.footprints)]


def _table(summary: Summary) -> Item:
    rows = tuple(
        Row(
            footprint.name,
            (
                number(footprint.flights, 0),
                unbroken(footprint.place),
                number(footprint.major_km, 1),
                number(footprint.minor_km, 1),
                number(footprint.azimuth_deg, 0),
            ),
        )
        for footprint in summary.footprints
    )
    titles = (
        "flights",
        "mean",
        "semi-major axis, km",
        "semi-minor axis, km",
        "azimuth from north, deg",
    )
    finding = "In footprints.kml beside this page too."
    table = PageTable(tuple(map(Column, titles)), rows, finding)
    return item(f"Mean places and {100 * SHARE:g} % ellipses", table)


def _figure(summary: Summary, footprint: Footprint) -> Item:
    """Draw the places of the first flights about the mean, with the ellipse."""
    sample = {name: values[:CLOUD] for name, values in summary.sample.items()}
    start = f"{FALLEN}{footprint.slug}_"
    latitude, longitude = sample[f"{start}latitude_deg"], sample[f"{start}longitude_deg"]
    good = sample["succeeded"].astype(bool)
    kinds: tuple[tuple[str, Role, Shape, bool], ...] = (
        ("success", "here", "cloud", True),
        ("failure", "thesis", "marks", False),
    )
    series = []
    for name, role, shape, which in kinds:
        rows = np.flatnonzero(np.isfinite(latitude) & (good == which))
        if rows.size:
            x, y = footprint.beside(latitude[rows], longitude[rows]).T
            texts = tuple(f"flight {flight}" for flight in sample["flight"][rows].tolist())
            series.append(Series(name, role, shape, tuple(x.tolist()), tuple(y.tolist()), texts))
    if footprint.outline():
        x, y = footprint.ellipse().T
        edge = f"{100 * SHARE:g} %"
        series.append(Series(edge, "other", "line", tuple(x.tolist()), tuple(y.tolist())))
    figure = Figure(
        Axis("east of the mean", "km"),
        Axis("north of the mean", "km"),
        tuple(series),
        finding=f"{footprint.words}.",
    )
    return item(capitalised(footprint.name), figure, f"The first {len(good):,} flights.")
