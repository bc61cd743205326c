# SPDX-License-Identifier: Apache-2.0
"""Repeat some flights of a campaign for the tracks on its globe."""

from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress

import numpy as np

from ares_studies.closed_loop import ready_law
from ares_studies.flight_page.globe import Globe, GlobeFlight, ring, way_beside_others
from ares_studies.flight_page.land import land_on
from ares_studies.montecarlo.flights import Settings
from ares_studies.montecarlo.footprints import SHARE, Footprint
from ares_studies.montecarlo.statistics import Summary
from ares_studies.pages.parts import Role
from ares_vehicle_sim.dispersions import Dispersions
from ares_vehicle_sim.simulator import CommandRefused, Simulator

#: Sampling interval of repeated flights; their least and greatest number.
ONE_OF = 200
FEWEST, MOST = 20, 100
#: Largest initial zoom of the globe, on which the tracks are close to each other.
NEAREST = 5.0

#: Label and colour of the flights on the globe.
ARRIVED: tuple[str, Role] = ("arrived", "here")
FAILED: tuple[str, Role] = ("failed", "thesis")
NOMINAL: tuple[str, Role] = ("the nominal flight", "other")
#: The same of the ellipses where pieces come down.
FOOTPRINTS: tuple[str, Role] = (f"where pieces come down, {100 * SHARE:g} % ellipse", "otis")


def sampled(summary: Summary) -> list[int]:
    """Select successful flights, evenly spread over the sample."""
    arrived = summary.sample["flight"][summary.sample["succeeded"].astype(bool)]
    shown = min(len(arrived), MOST, max(FEWEST, summary.tally.n // ONE_OF))
    chosen = np.linspace(0, max(len(arrived) - 1, 0), shown).astype(int)
    return [int(flight) for flight in arrived[chosen]]


def make_ways(
    settings: Settings,
    flights: Iterable[int],
    failures: Mapping[int, str],
    footprints: Sequence[Footprint] = (),
) -> Globe:
    """Make the globe of a campaign.

    Args:
        settings: of the campaign.
        flights: successful flights.
        failures: failed flights with their reasons.
        footprints: of what comes down.
    """
    refly = _Refly(settings)
    # the first one is drawn behind the others
    shown = [refly.way(None, NOMINAL[0], NOMINAL[1])]
    shown += [refly.way(k, f"flight {k}", ARRIVED[1]) for k in flights]
    shown += [refly.way(k, f"flight {k}: {why}", FAILED[1]) for k, why in failures.items()]
    return Globe(
        flights=tuple(shown),
        land=land_on(settings.mission.environment.earth.equatorial_radius_m),
        ends=("",) * len(shown),
        nearest=NEAREST,
        areas=tuple(ring(outline) for one in footprints if (outline := one.outline())),
        areas_role=FOOTPRINTS[1],
    )


class _Refly:
    """Repeat flights of a campaign step by step."""

    def __init__(self, settings: Settings) -> None:
        self._settings = settings
        self._law = ready_law(
            settings.mission, settings.law, settings.law_settings, plan=settings.plan
        )

    def way(self, flight: int | None, name: str, role: Role) -> GlobeFlight:
        """Fly one flight for the globe; None: the undispersed one."""
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
            # a refused command changes nothing, as in the campaign
            with suppress(CommandRefused):
                simulator.command(law.steering)
            simulator.advance()
        states = np.array(rows)
        return way_beside_others(
            settings.mission, states[:, 0], states[:, 1:], name, role, faint=role != NOMINAL[1]
        )
