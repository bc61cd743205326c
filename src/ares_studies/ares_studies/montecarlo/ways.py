# SPDX-License-Identifier: Apache-2.0
"""Ways of a campaign's flights over the Earth: some of them flown again, for its globe."""

from collections.abc import Iterable, Mapping
from contextlib import suppress

import numpy as np
from numpy.typing import NDArray

from ares_models.mission import Mission
from ares_studies.closed_loop import ready_law
from ares_studies.flight_page.geometry import ground_track
from ares_studies.flight_page.globe import Globe, GlobeFlight, Way, rounded
from ares_studies.flight_page.land import land_on
from ares_studies.montecarlo.flights import Settings
from ares_studies.montecarlo.statistics import Summary
from ares_studies.pages.parts import Role
from ares_vehicle_sim.dispersions import Dispersions
from ares_vehicle_sim.simulator import CommandRefused, Simulator

#: One of so many flights is flown again, but for these bounds.
ONE_OF = 200
FEWEST, MOST = 20, 100
#: Points of a way.
POINTS = 60

#: How near the globe is seen at first, at most: the ways are close to each other.
NEAREST = 5.0

#: What the flights on the globe are, and in which colour.
ARRIVED: tuple[str, Role] = ("arrived", "here")
FAILED: tuple[str, Role] = ("failed", "thesis")
NOMINAL: tuple[str, Role] = ("the nominal flight", "other")


def sampled(summary: Summary) -> list[int]:
    """Flights of a campaign that succeeded, evenly spread: each is as random as any."""
    arrived = summary.sample["flight"][summary.sample["succeeded"].astype(bool)]
    shown = min(len(arrived), MOST, max(FEWEST, summary.tally.n // ONE_OF))
    chosen = np.linspace(0, max(len(arrived) - 1, 0), shown).astype(int)
    return [int(flight) for flight in arrived[chosen]]


def make_ways(settings: Settings, flights: Iterable[int], failures: Mapping[int, str]) -> Globe:
    """The globe of a campaign.

    Args:
        settings: of the campaign.
        flights: that arrived.
        failures: flights that failed, and why.
    """
    refly = _Refly(settings)
    # the first one lies at the back
    shown = [refly.way(None, NOMINAL[0], NOMINAL[1])]
    shown += [refly.way(k, f"flight {k}", ARRIVED[1]) for k in flights]
    shown += [refly.way(k, f"flight {k}: {why}", FAILED[1]) for k, why in failures.items()]
    return Globe(
        flights=tuple(shown),
        land=land_on(settings.mission.environment.earth.equatorial_radius_m),
        ends=("",) * len(shown),
        nearest=NEAREST,
    )


class _Refly:
    """Flies flights of a campaign again, step by step."""

    def __init__(self, settings: Settings) -> None:
        self._settings = settings
        self._law = ready_law(settings.mission, settings.law, settings.law_settings)

    def way(self, flight: int | None, name: str, role: Role) -> GlobeFlight:
        """A flight on the globe; None: the one that nothing disperses."""
        settings, law = self._settings, self._law
        dispersions = Dispersions() if flight is None else settings.dispersions
        simulator = Simulator(
            settings.mission, settings.options, dispersions, settings.seed, flight or 0
        )
        law.reset()
        rows = []
        while True:
            plant = simulator.plant
            rows.append((float(plant["time"]), *plant["position"].tolist()))
            if simulator.complete:
                break
            law.step(simulator.navigation)
            # a command that cannot be flown changes nothing, as in the campaign
            with suppress(CommandRefused):
                simulator.command(law.steering)
            simulator.advance()
        return _on_globe(settings.mission, np.array(rows), name, role)


def _on_globe(mission: Mission, rows: NDArray[np.float64], name: str, role: Role) -> GlobeFlight:
    """A way from its states: time and position, shape (n, 4)."""
    kept = rows[np.unique(np.linspace(0, len(rows) - 1, POINTS).astype(int))]
    time, position = kept[:, 0], kept[:, 1:]
    track = ground_track(time, position, mission.earth())
    radius = mission.environment.earth.equatorial_radius_m
    return GlobeFlight(
        name=name,
        role=role,
        time_s=rounded(time, 1),
        latitude_deg=rounded(track.latitude_deg, 3),
        longitude_deg=rounded(track.longitude_deg, 3),
        height=rounded(np.linalg.norm(position, axis=1) / radius - 1.0, 5),
        ways=(Way(name, role, 0, len(kept) - 1),),
        impact_time_s=(),
        impact_latitude_deg=(),
        impact_longitude_deg=(),
        faint=role != NOMINAL[1],
    )
