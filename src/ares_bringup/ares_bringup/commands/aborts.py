# SPDX-License-Identifier: Apache-2.0
"""Make the abort map for `ares aborts`. No ROS."""

import json
from collections import Counter
from dataclasses import dataclass
from pathlib import Path

from rich.console import Console
from rich.table import Table
from rich.text import Text

from ares_bringup.options import CannotStart, refusal, self_starting
from ares_bringup.progress import bar
from ares_bringup.report import console, shown_path
from ares_bringup.shared_plans import shared_plans
from ares_bringup.whole_file import check_file, write_whole
from ares_models.mission import Mission, load_mission
from ares_optimizer.foreknown import begin_times
from ares_studies.aborts.abort_map import AbortMap, MapMaker, MapSettings, Share
from ares_studies.aborts.report import ENDS, make_report, render

EXIT_MADE = 0
EXIT_POINTS_FAILED = 1


@dataclass(frozen=True)
class AbortOptions:
    """Hold the options of an abort map.

    Attributes:
        mission: name of a shipped mission or path of a mission file.
        guidance: guidance law.
        step_s: interval between failure times, s.
        as_json: print one JSON object instead of tables.
        out: file of the page; None: no page.
    """

    mission: str
    guidance: str
    step_s: float
    as_json: bool = False
    out: Path | None = None

    def settings(self) -> MapSettings:
        """Return the settings of the map, checked.

        Raises:
            CannotStart: mission or law is invalid; one line.
        """
        mission: Mission | None = None
        try:
            self_starting(self.guidance)
            mission = load_mission(self.mission)
            # refuses a mission whose failures have no time
            begin_times(mission.arrays(), mission.start().time_s)
        except ValueError as error:
            raise refusal(error, mission) from error
        return MapSettings(mission, self.guidance, self.step_s)


@shared_plans()
def aborts(options: AbortOptions) -> int:
    """Make a map, print its summary, and write its page.

    Args:
        options: of the map.

    Returns:
        0; 1 if points failed.

    Raises:
        CannotStart: bad input; one line.
    """
    if options.out is not None:
        check_file(options.out)
    settings = options.settings()
    try:
        maker = MapMaker(settings)
    except ValueError as error:
        raise CannotStart(f"mission {settings.mission.name}: {error}") from error
    made = _watched(maker, quiet=options.as_json)
    if options.out is not None:
        write_whole(options.out, render(make_report(made, _facts(options, made))).encode())
    if options.as_json:
        print(json.dumps(made.to_json(), indent=1, allow_nan=False))
    else:
        _print(made, console())
        if options.out is not None:
            print(shown_path(str(options.out)))
    return EXIT_POINTS_FAILED if made.wrong else EXIT_MADE


def _watched(maker: MapMaker, quiet: bool) -> AbortMap:
    """Make the map, with a progress bar unless `quiet`."""
    with bar(quiet=quiet) as progress:
        task = progress.add_task("flying", total=maker.count)
        work = maker.make()
        while True:
            try:
                progress.update(task, completed=next(work))
            except StopIteration as over:
                made: AbortMap = over.value
                return made


def _facts(options: AbortOptions, made: AbortMap) -> dict[str, str]:
    return {
        "mission": options.mission,
        "guidance": made.law,
        "points": f"{len(made.points):,}, every {made.step_s:g} s",
        "safe perigee": f"{made.safe_perigee_altitude_m:,.0f} m over the equator",
        "optimum without failure": f"{made.nominal.m_f_kg:,.1f} kg",
    }


def _print(made: AbortMap, out: Console) -> None:
    out.print(Text(made.mission.title), style="bold")
    out.print(f"guidance {made.law}, {len(made.points):,} points, every {made.step_s:g} s")
    out.print()
    table = Table(box=None, pad_edge=False)
    as_knew, as_told = "as the one that knew", "as one told then"
    for column in ("", "points", "optimizer that knew", "flown", as_knew, as_told):
        right = column in ("points", as_knew, as_told)
        table.add_column(column, justify="right" if right else "left")
    for row in made.rows:
        n = len(row.points)
        table.add_row(
            row.name,
            f"{n:,}",
            _ends(Counter(point.optimum.end for point in row.points)),
            _ends(Counter(point.flown.end for point in row.points)),
            _percent(Share(sum(point.within for point in row.points), n)),
            _percent(Share(sum(point.within_told for point in row.points), n)),
        )
    told = made.shares(told=True)
    for name, share in made.shares().items():
        row_of = (name, f"{share.of:,}", "", "", _percent(share), _percent(told[name]))
        table.add_row(*row_of, style="bold")
    out.print(table)
    if made.areas and made.outside.of:
        fall = made.outside
        out.print(
            f"of {fall.of:,} suborbital flights {fall.count:,} fall outside all "
            f"{len(made.areas)} areas, {_percent(fall)}"
        )
    if made.unfound:
        out.print(
            f"at {made.unfound:,} points the optimizer that was told found no flight above the "
            "ground; they count as suborbital"
        )
    for point in made.wrong[:20]:
        out.print(f"failed: {point.failure.kind} at {point.at_s:g} s: {point.wrong}")


def _ends(counts: Counter[object]) -> str:
    return ", ".join(f"{name} {counts[end]:,}" for end, (_, name) in ENDS.items() if counts[end])


def _percent(share: Share) -> str:
    return f"{share.percent:.2f} %" if share.of else "-"
