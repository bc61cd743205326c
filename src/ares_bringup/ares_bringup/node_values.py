# SPDX-License-Identifier: Apache-2.0
"""Derive the parameters of a flight's nodes from its options."""

from collections.abc import Mapping
from typing import Any

from ares_bringup.inputs import check_possible, heating_margin, needs_plan, needs_trajectory
from ares_bringup.keeper import GUIDANCE, OPTIMIZER, RECORDER, SIMULATOR, VIEW
from ares_bringup.options import PEG, CannotStart, FlyOptions
from ares_bringup.parameter_tables import known
from ares_bringup.watch import START_TIMEOUT
from ares_node.names import own_frames
from ares_node.requirements import unmet


def node_parameters(
    options: FlyOptions, bag: str | None, flight_id: int
) -> dict[str, dict[str, Any]]:
    """Return the parameters of each node of the flight, by node name.

    Args:
        options: the flight.
        bag: folder of the bag; None: no recorder.
        flight_id: identity of the flight.
    """
    given: dict[str, Any] = {
        "pace": 0.0,
        **options.settings,
        "flight_id": flight_id,
        "mission": options.mission,
        "law": options.guidance,
        "start_timeout_s": START_TIMEOUT,
        "expected_recorders": int(bag is not None),
        "expected_judges": 1,
        "foxglove_port": options.foxglove_port,
        "frame_prefix": own_frames(options.namespace),
        "bag": bag,
    }
    if options.flight is not None:
        from ares_vehicle_sim.dispersions import STANDARD
        from ares_vehicle_sim.simulator import CAMPAIGN

        stepped = {
            "dispersions": STANDARD,
            "flight": options.flight,
            "navigation_period_s": CAMPAIGN.navigation_period_s,
            "integration_step_s": CAMPAIGN.integration_step_s,
        }
        given = stepped | given
    if "failure" in given:
        check_possible(given["failure"], options.mission)
    if given.get("heating_source") == "model" and "dispersions" in given:
        given["heating_margin"] = heating_margin(given["dispersions"], options.mission)
    names = [SIMULATOR, GUIDANCE]
    if optimizer := optimizer_values(given):
        if reason := unmet("ares_optimizer", "solve"):
            raise CannotStart(reason)
        names.append(OPTIMIZER)
    if options.view or options.foxglove_port:
        names.append(VIEW)
    if bag is not None:
        names.append(RECORDER)
    return {name: known(name, given | optimizer) for name in names}


def optimizer_values(flown: Mapping[str, Any]) -> dict[str, Any]:
    """Return the parameters of the optimizer's node; empty if the flight does not need it.

    Args:
        flown: parameters by name: mission, law, initial_guess, as far as given.
    """
    guess = flown.get("initial_guess", "none")
    mission = str(flown.get("mission", "ares_v"))
    law = str(flown.get("law", PEG))
    if guess == "optimizer" or needs_plan(mission, law):
        return {"mission": mission}
    if guess == "analytic" or needs_trajectory(law):
        return {"mission": mission, "method": "analytic"}
    return {}
