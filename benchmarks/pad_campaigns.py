# SPDX-License-Identifier: Apache-2.0
"""Fly dispersed launches from the pad by law and boost steering; compare with each one's optimum.

Winds, gusts, thrust, specific impulse, masses, drag and density are drawn by `standard_pad`. The
optimum of a flight knows what was drawn for it, but not the gust.
"""

import argparse
import time

import numpy as np
from figures import Figures, keep_option

from ares_guidance.settings import LawSettings
from ares_models.mission import load_mission
from ares_studies.montecarlo.flights import FlightRange, Settings
from ares_studies.montecarlo.reach import reach
from ares_vehicle_sim.dispersions import load_dispersions

MISSIONS = ("delta_iii_pad", "falcon9_leo_pad", "ariane5_eca_pad")
WAYS = (("peg", "programme"), ("optimal", "programme"), ("optimal", "replan"))
#: Success of a flight: these fields of its result are all 1.
ARRIVED = ("terminal_accuracy", "fairing_off", "heating_kept")


def main() -> None:
    """Run from the command line."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("-n", type=int, default=10_000, help="flights of each campaign")
    parser.add_argument("--replans", type=int, default=2_000, help="of those that plan anew")
    parser.add_argument("--optima", type=int, default=60, help="flights beside their own optimum")
    parser.add_argument("--missions", nargs="+", default=MISSIONS)
    keep_option(parser)
    options = parser.parse_args()
    about = f"{options.n:,} flights from the pad, {options.replans:,} by replan, standard_pad."
    figures = Figures(__file__, about)
    dispersions = load_dispersions("standard_pad")
    for name in options.missions:
        mission = load_mission(name)
        settings = Settings(mission, dispersions).planned()
        optima = np.array([reach(settings, k).m_f_kg for k in range(options.optima)])
        for law, boost in WAYS:
            chosen = LawSettings(boost_steering=boost)
            flights = FlightRange(
                Settings(mission, dispersions, law=law, law_settings=chosen).planned()
            )
            flights.fly(0, 1)
            began = time.process_time()
            count = options.replans if boost == "replan" else options.n
            flown = flights.fly(0, count)
            spent = time.process_time() - began
            results = flown.results
            arrived = np.all([results[key] == 1 for key in ARRIVED], axis=0)
            beside = arrived[: options.optima] & np.isfinite(optima)
            masses = results["mass"][: options.optima][beside]
            lost = 100.0 * (1.0 - masses / optima[beside])
            what = f"{name}, {law}, {boost}"
            figures.add(f"{what}: arrived", int(arrived.sum()), "")
            figures.add(f"{what}: final mass, mean", float(results["mass"][arrived].mean()), "kg")
            figures.add(f"{what}: loss in the median", float(np.median(lost)), "%")
            figures.add(f"{what}: loss at worst", float(lost.max()), "%")
            pressure = results["most_dynamic_pressure"] / 1e3
            figures.add(f"{what}: greatest q, mean", float(pressure.mean()), "kPa")
            figures.add(f"{what}: greatest q, 99.7 %", float(np.quantile(pressure, 0.997)), "kPa")
            angle = results["most_q_alpha"] / 1e3
            figures.add(f"{what}: q alpha, 99.7 %", float(np.quantile(angle, 0.997)), "kPa rad")
            left = float(np.quantile(results["mass"][arrived], 0.003))
            figures.add(f"{what}: final mass of 99.7 %", left, "kg")
            figures.add(f"{what}: flights per second of one core", count / spent, "1/s")
    if options.keep:
        figures.keep()


if __name__ == "__main__":
    main()
