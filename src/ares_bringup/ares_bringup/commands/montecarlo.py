# SPDX-License-Identifier: Apache-2.0
"""Fly campaigns for `ares montecarlo`. No ROS."""

import math
import sys
import time
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, replace
from itertools import islice
from pathlib import Path
from shlex import join
from typing import Any

import numpy as np
from rich.console import Console
from rich.progress import ProgressColumn, Task
from rich.table import Table
from rich.text import Text

from ares_bringup.bag_paths import new_bag, workspace_root
from ares_bringup.commands.interrupts import note_written, report_interrupt
from ares_bringup.options import PEG, refusal, refusals, self_starting
from ares_bringup.parameter_tables import offered
from ares_bringup.plain_json import print_json
from ares_bringup.progress import bar
from ares_bringup.rehearsal import rehearse
from ares_bringup.report import console, number, shown_path
from ares_bringup.shared_plans import shared_plans
from ares_bringup.whole_file import write_whole
from ares_guidance.settings import LawSettings
from ares_models.atmosphere import AtmosphereError
from ares_models.input_file import InputError
from ares_models.judge import FIGURES
from ares_models.mission import Mission, load_mission
from ares_studies.export.kml import footprints_kml
from ares_studies.montecarlo.campaign import CampaignPlan, fly_campaign
from ares_studies.montecarlo.engines import EngineError, choose
from ares_studies.montecarlo.flights import FlightRange, Settings
from ares_studies.montecarlo.footprints import Footprints
from ares_studies.montecarlo.reach import Reach, reaches
from ares_studies.montecarlo.report import make_report, render
from ares_studies.montecarlo.statistics import FAILURES, Load, Summary, Tally, summarize
from ares_studies.montecarlo.store import Store, StoreError, check_campaign
from ares_studies.montecarlo.table import FLAGS, Verdict, make_table
from ares_studies.montecarlo.ways import make_ways, sampled
from ares_vehicle_sim.dispersions import STANDARD, Dispersions, load_dispersions
from ares_vehicle_sim.simulator import CAMPAIGN

EXIT_DONE = 0
EXIT_INTERRUPTED = 130

#: Folder of new campaigns in the workspace.
CAMPAIGNS = "campaigns"
REPORT = "report.html"
FOOTPRINTS = "footprints.kml"
#: Faults of what was given, each with a text of one line.
FAULTS = (InputError, AtmosphereError, StoreError, EngineError)
#: Share of a tolerance from which on a J2 that is not on board is told as a cause of misses.
MUCH = 0.5
#: Label, unit, factor and decimals of the loads in the summary.
LOAD_WORDS = {
    "max_q_pa": ("max q", "kPa", 1e-3, 2),
    "max_q_alpha_pa_rad": ("max q alpha", "Pa rad", 1.0, 0),
}


@dataclass(frozen=True)
class CampaignOptions:
    """Hold the options of a campaign.

    Attributes:
        count: flights.
        mission: name of a shipped mission or path of a mission file.
        guidance: guidance law.
        dispersions: name of shipped dispersions or path of a file.
        seed: master seed.
        only: fly only these flights, and store nothing.
        out: folder, new or of a campaign to continue; None: a new one.
        as_json: print one JSON object instead of tables.
        workers: threads; None: one per core.
        scheduler: address of a Dask scheduler; None: this machine.
        law_settings: of `LawSettings` by name, as far as given.
        success_width: stop when the interval of the success rate is narrower.
        mass_width_kg: stop when the interval of the mean final mass is narrower.
    """

    count: int
    mission: str
    guidance: str
    dispersions: str = STANDARD
    seed: int = 0
    only: tuple[int, ...] = ()
    out: Path | None = None
    as_json: bool = False
    workers: int | None = None
    scheduler: str | None = None
    law_settings: Mapping[str, Any] = field(default_factory=dict)
    success_width: float | None = None
    mass_width_kg: float | None = None

    def settings(self) -> Settings:
        """Return the settings of the campaign, checked.

        Raises:
            CannotStart: mission, dispersions, law or a setting is invalid; one line.
        """
        given = dict(self.law_settings)
        mission: Mission | None = None
        try:
            self_starting(self.guidance)
            mission = load_mission(self.mission)
            dispersions = load_dispersions(self.dispersions, mission)
            if given.get("heating_source") == "model":
                given["heating_margin"] = dispersions.heating_margin()
            return Settings(
                mission=mission,
                dispersions=dispersions,
                seed=self.seed,
                law=self.guidance,
                law_settings=LawSettings(**given),
                options=CAMPAIGN,
            )
        except ValueError as error:
            raise refusal(error, mission) from error

    def command(self, *verb: str) -> str:
        """Return an `ares` command with the same settings."""
        words = ["./ares", *verb, "--mission", self.mission, "--guidance", self.guidance]
        words += ["--dispersions", self.dispersions, "--seed", str(self.seed)]
        for option, row in offered().items():
            if row.name in self.law_settings:
                words += [f"--{option.replace('_', '-')}", str(self.law_settings[row.name])]
        return join(words)


@shared_plans()
def montecarlo(options: CampaignOptions, begun: float) -> int:
    """Fly a campaign and print its summary.

    Args:
        options: the campaign.
        begun: start of the command, s of time.monotonic().

    Returns:
        0, or 130 when interrupted.

    Raises:
        CannotStart: bad input; one line.
    """
    settings = options.settings()
    if options.out is not None:
        with refusals(*FAULTS):
            check_campaign(options.out)
    clock = time.monotonic()
    flown = {"mission": options.mission, "law": settings.law}
    if line := rehearse(flown | vars(settings.options) | vars(settings.law_settings)):
        print(line, file=sys.stderr, flush=True)
    planning_s = time.monotonic() - clock
    if options.only:
        return _fly_alone(options, settings, begun)
    folder = options.out or new_bag(f"{settings.mission.name}_{settings.law}", _campaigns())
    with refusals(*FAULTS):
        engine = choose(options.scheduler, options.workers)
        clock = time.monotonic()
        settings = settings.planned()
        planning_s += time.monotonic() - clock
        # compiles the kernels, and checks that the dispersions fit the mission
        FlightRange(settings).fly(0, 1)
        with Store(folder, settings) as store:
            note_written(shown_path(str(store.folder)))
            plan = CampaignPlan(
                settings, options.count, options.success_width, options.mass_width_kg
            )
            with _Watch(store.count(), options.count, quiet=options.as_json) as watch:
                try:
                    fly_campaign(plan, store, engine, watch)
                except KeyboardInterrupt:
                    watch.stop()
                    _say_interrupted(store, options)
                    return EXIT_INTERRUPTED
            note_written(str(store.flights))
            nominal = nominal_flight(settings)
            summary = summarize(
                store.flights, float(nominal["propellant_used"]), Footprints(settings.mission)
            )
            footprints = store.folder / FOOTPRINTS
            kml = footprints_kml(settings.mission.title, summary.footprints)
            write_whole(footprints, kml)
            reached = reaches(settings, summary.worst[FAILURES])
            report = _write_report(options, settings, summary, reached, store)
            times = {
                "flights_per_s": watch.rate,
                "planning_s": planning_s if settings.plan else 0.0,
                "wall_s": time.monotonic() - begun,
                "by_peg_s": _by_peg(settings, nominal),
            }
            _report(options, settings, summary, reached, times, (store.flights, report))
    return EXIT_DONE


def _campaigns() -> Path:
    return (workspace_root() or Path.cwd()) / CAMPAIGNS


def nominal_flight(settings: Settings) -> np.void:
    """Return the undispersed flight, record RESULT."""
    flown: np.void = FlightRange(replace(settings, dispersions=Dispersions())).fly(0, 1).results[0]
    return flown


def foreign_j2(settings: Settings) -> str:
    """Describe what a J2 that guidance has not takes of the tolerances; "" if it is not much."""
    true, known = settings.dispersions.j2, settings.mission.environment.j2
    if true is None or true == known:
        return ""
    flown = FlightRange(replace(settings, dispersions=Dispersions(j2=true))).fly(0, 1).results[0]
    shares = {
        figure.name.replace("_", " "): abs(flown[f"{figure.name}_error"])
        / flown[f"{figure.name}_allowed"]
        for figure in FIGURES
        if int(flown["judged"]) & figure.bit
    }
    name, share = max(shares.items(), key=lambda item: item[1], default=("", 0.0))
    if not share > MUCH:
        return ""
    return (
        f"j2            {true:g} in the dispersions, {known:g} on board: alone it takes "
        f"{100.0 * share:,.0f} % of the tolerance of {name}; name it in environment.j2"
    )


def _by_peg(settings: Settings, flown: np.void) -> float:
    """Return for how long peg stands in for another law in a flight, record RESULT, s."""
    if settings.law == PEG:
        return 0.0
    return float(flown["by_peg"]) * settings.options.navigation_period_s


def _say_interrupted(store: Store, options: CampaignOptions) -> None:
    there = store.count()
    folder = shown_path(str(store.folder))
    report_interrupt(
        f"{there:,} of {options.count:,} flights are in {folder}; "
        f"the same command with --out {folder} goes on"
    )


# ---- progress


class _Rate(ProgressColumn):
    """Show flights per second since the start."""

    def render(self, task: Task) -> Text:
        elapsed = task.finished_time if task.finished else task.elapsed
        if not elapsed or not task.completed:
            return Text("-/s")
        return Text(f"{task.completed / elapsed:,.0f}/s")


class _Watch:
    """Count and time the flights, with a progress bar.

    Attributes:
        flown: flights of this run.
        seconds: wall time spent flying them.
    """

    def __init__(self, there: int, total: int, quiet: bool) -> None:
        self.flown = 0
        self.seconds = 0.0
        self._failed = 0
        self._begun = time.monotonic()
        self._progress = bar(_Rate(), quiet=quiet)
        self._task = self._progress.add_task("flying", total=total - there)

    def __enter__(self) -> "_Watch":
        self._begun = time.monotonic()
        return self

    def __exit__(self, *_: object) -> None:
        self.stop()

    def stop(self) -> None:
        """Stop updating the bar."""
        self._progress.stop()

    def __call__(self, table: Any) -> None:
        """Count a chunk of flights; the first one shows the bar."""
        self._progress.start()
        self.flown += table.num_rows
        self.seconds = time.monotonic() - self._begun
        self._failed += table.num_rows - int(np.count_nonzero(table["succeeded"].to_numpy()))
        self._progress.update(
            self._task,
            completed=self.flown,
            description=f"flying, {self._failed:,} failed" if self._failed else "flying",
        )

    @property
    def rate(self) -> float | None:
        """Return the flights per second; None if none was flown."""
        return self.flown / self.seconds if self.seconds > 0.0 else None


# ---- results


def _write_report(
    options: CampaignOptions,
    settings: Settings,
    summary: Summary,
    reached: Mapping[int, Reach],
    store: Store,
) -> Path:
    """Write the page of the campaign beside its flights."""
    facts = {
        "flights": f"{summary.tally.n:,}",
        "guidance": settings.law,
        "mission": options.mission,
        "dispersions": options.dispersions,
        "seed": str(settings.seed),
        "heating": settings.law_settings.heating_source,
        "guidance cycle": f"{settings.law_settings.cycle_period_s:g} s",
        "file": str(store.flights.absolute()),
    }
    globe = make_ways(settings, sampled(summary), summary.failed, summary.footprints)
    page = render(make_report(settings, summary, facts, options.command("fly"), reached, globe))
    path = store.folder / REPORT
    write_whole(path, page.encode())
    return path


def _report(
    options: CampaignOptions,
    settings: Settings,
    summary: Summary,
    reached: Mapping[int, Reach],
    times: Mapping[str, float | None],
    files: tuple[Path, Path],
) -> None:
    results, report = files
    said = {
        **_verdict(summary.tally),
        **times,
        "results": str(results.absolute()),
        "report": str(report.absolute()),
        "mission": settings.mission.name,
        "guidance": settings.law,
        "seed": settings.seed,
        "outcomes": dict(sorted(summary.tally.outcomes.items())),
        "intervals_95": {
            **{name: summary.tally.proportion(name) for name in (*FLAGS, "succeeded")},
            **dict(zip(("m_f_mean_kg", "m_f_std_kg"), summary.tally.mass_intervals(), strict=True)),
        },
        "propellant": {
            "nominal_kg": summary.reserve.nominal_kg,
            "bound_kg": summary.reserve.used_kg,
            "reserve_kg": summary.reserve.reserve_kg,
            "flights_needed": summary.reserve.needed,
        },
        "footprints": [asdict(footprint) for footprint in summary.footprints],
        "loads": {name: asdict(load) for name, load in summary.loads.items()},
        "influences": summary.influences,
        "failures": [
            {
                "flight": row["flight"],
                "outcome": row["outcome"],
                "reason": row["failure"],
                **_reach(reached.get(row["flight"])),
            }
            for row in summary.worst[FAILURES]
        ],
    }
    if options.as_json:
        print_json(said)
    else:
        _print(options, settings, summary, said, console())


def _reach(found: Reach | None) -> dict[str, Any]:
    if found is None:
        return {"within_reach": None, "optimum": None}
    return {"within_reach": found.within, "optimum": str(found)}


def _verdict(tally: Tally) -> dict[str, Any]:
    mean, deviation = tally.mass()
    return {
        "n": tally.n,
        "succeeded": tally.counts["succeeded"],
        **{name: tally.counts[name] for name in FLAGS},
        "m_f_kg": {"mean": mean, "std": deviation, "min": tally.least, "max": tally.most},
    }


def _print(
    options: CampaignOptions,
    settings: Settings,
    summary: Summary,
    said: dict[str, Any],
    out: Console,
) -> None:
    tally = summary.tally
    out.print(Text(settings.mission.title), style="bold")
    out.print(f"guidance {settings.law}, {tally.n:,} {'flights' if tally.n > 1 else 'flight'}")
    out.print()
    table = Table(box=None, pad_edge=False)
    for column in ("", "flights", "share", "95 % interval"):
        table.add_column(column, justify="left" if not column else "right")
    for name in ("succeeded", *FLAGS):
        low, high = tally.proportion(name)
        share = tally.counts[name] / tally.n
        interval = f"{100 * low:.3f} to {100 * high:.3f} %"
        row = (name.replace("_", " "), f"{tally.counts[name]:,}", f"{100 * share:.3f} %", interval)
        table.add_row(*row, style="bold" if name == "succeeded" else "")
    out.print(table)
    out.print()
    names = ("final mass    mean", "              std")
    for name, value, (low, high) in zip(names, tally.mass(), tally.mass_intervals(), strict=True):
        out.print(f"{name} {number(value, 1)} kg ({number(low, 1)} to {number(high, 1)})")
    out.print(f"              {tally.least:,.1f} to {tally.most:,.1f} kg")
    out.print("reserve       " + _reserve(summary, tally.n))
    if said["by_peg_s"]:
        out.print(
            f"by peg        {said['by_peg_s']:,.0f} s of the undisturbed flight: {settings.law} "
            "has no solution of its own there",
            soft_wrap=True,
        )
    for name, load in summary.loads.items():
        out.print(_load(name, load), soft_wrap=True)
    for footprint in summary.footprints:
        out.print(footprint.words, soft_wrap=True)
    for name, influences in summary.influences.items():
        first = islice(influences.items(), 3)
        strongest = ", ".join(f"{draw} {correlation:+.2f}" for draw, correlation in first)
        if strongest:
            out.print(f"{name} follows {strongest}")
    for failure in said["failures"]:
        optimum = f"; {failure['optimum']}" if failure["optimum"] else ""
        out.print(f"flight {failure['flight']}: {failure['reason']}{optimum}")
    missing = tally.n - tally.counts["succeeded"] - len(said["failures"])
    if missing:
        out.print(f"and {missing:,} more failures")
    if tally.outcomes[Verdict.TARGET_MISSED] and (line := foreign_j2(settings)):
        out.print(line, soft_wrap=True)
    out.print()
    spent = f"wall time {said['wall_s']:.1f} s"
    if said["planning_s"]:
        spent += f", {said['planning_s']:.1f} s of it for the plan"
    if said["flights_per_s"]:
        spent += f", {number(said['flights_per_s'], 0)} flights/s"
    out.print(spent)
    out.print(f"flights   {shown_path(said['results'])}", soft_wrap=True)
    out.print(f"report    {shown_path(said['report'])}", soft_wrap=True)
    out.print(f"again     {options.command('fly')} --flight K", soft_wrap=True)


def _load(name: str, load: Load) -> str:
    """Describe a load of the air, and what is left of its limit."""
    label, unit, factor, decimals = LOAD_WORDS[name]
    mean, most = (number(factor * value, decimals) for value in (load.mean, load.most))
    text = f"{label:13} mean {mean}, most {most} {unit}"
    if load.limited:
        text += f"; within the limit in {load.kept:,} of {load.limited:,} flights"
        text += f", worst {100 * load.worst:.0f} % of it"
    return text


def _reserve(summary: Summary, n: int) -> str:
    reserve = summary.reserve
    if math.isfinite(reserve.reserve_kg):
        return f"{reserve.reserve_kg:,.0f} kg of propellant for 99.7 % of flights, 90 % confidence"
    if n < reserve.needed:
        return f"needs at least {reserve.needed} flights"
    return "has no bound: too many flights did not arrive"


# ---- single flights


def _fly_alone(options: CampaignOptions, settings: Settings, begun: float) -> int:
    tally = Tally()
    rows = []
    with refusals(*FAULTS):
        flyer = FlightRange(settings)
        clock = time.monotonic()
        for flight in options.only:
            names = settings.mission.jettison_names
            table = make_table(flyer.fly(flight, 1), flyer.columns, names, flyer.pieces)
            tally.add(table)
            rows += table.to_pylist()
        seconds = time.monotonic() - clock
    if options.as_json:
        said = {
            **_verdict(tally),
            "flights_per_s": len(rows) / seconds,
            "wall_s": time.monotonic() - begun,
            "results": None,
            "flights": rows,
        }
        print_json(said)
        return EXIT_DONE
    out = console()
    for row in rows:
        out.print(Text(f"flight {row['flight']}: {row['failure'] or 'success'}"), style="bold")
        for name, value in row.items():
            if isinstance(value, float):
                out.print(
                    f"  {name:<40}{value:>20,.6g}"
                    if abs(value) < 1e4
                    else f"  {name:<40}{value:>20,.3f}"
                )
        out.print()
    return EXIT_DONE
