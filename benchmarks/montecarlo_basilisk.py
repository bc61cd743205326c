# SPDX-License-Identifier: Apache-2.0
"""Fly Basilisk's Monte Carlo: our ascent's length and dispersions, without guidance.

    python benchmarks/montecarlo_basilisk.py FLIGHTS PROCESSES

A flight: a spacecraft of constant mass under point-mass gravity and one constant thrust vector,
rigid-body equations, 611 Runge-Kutta 4 steps of 1 s in compiled code, open loop. Dispersed:
initial position 1 km and velocity 10 m/s per axis, mass 1 %. The bare flight, built and flown
in one process without the controller, is timed too.
"""

import json
import math
import sys
import tempfile
import time

from Basilisk.simulation import extForceTorque, spacecraft
from Basilisk.utilities import SimulationBaseClass, macros, simIncludeGravBody
from Basilisk.utilities.MonteCarlo.Controller import Controller
from Basilisk.utilities.MonteCarlo.Dispersions import NormalDispersion, NormalVectorCartDispersion
from Basilisk.utilities.MonteCarlo.RetentionPolicy import RetentionPolicy

POSITION_M = [-5255758.0, -2044694.0, 3058330.0]
VELOCITY_M_S = [413.927, -1839.599, 202.550]
MASS_KG = 300e3
THRUST_N = 3e6
SECONDS = 611.0


class Ascent(SimulationBaseClass.SimBaseClass):
    """Hold a flight, ready to run."""

    def __init__(self):
        """Create spacecraft, gravity, thrust, and a recorder of the state."""
        super().__init__()
        process = self.CreateNewProcess("process")
        process.addTask(self.CreateNewTask("task", macros.sec2nano(1.0)))
        self.craft = spacecraft.Spacecraft()
        self.craft.ModelTag = "craft"
        self.craft.hub.mHub = MASS_KG
        self.craft.hub.r_CN_NInit = POSITION_M
        self.craft.hub.v_CN_NInit = VELOCITY_M_S
        self.gravity = simIncludeGravBody.gravBodyFactory()
        self.gravity.createEarth().isCentralBody = True
        self.gravity.addBodiesTo(self.craft)
        self.thrust = extForceTorque.ExtForceTorque()
        self.thrust.ModelTag = "thrust"
        speed = math.hypot(*VELOCITY_M_S)
        self.thrust.extForce_N = [[THRUST_N * v / speed] for v in VELOCITY_M_S]
        self.craft.addDynamicEffector(self.thrust)
        self.state = self.craft.scStateOutMsg.recorder(macros.sec2nano(SECONDS))
        for model in (self.craft, self.thrust, self.state):
            self.AddModelToTask("task", model)
        self.msgRecList = {"state": self.state}


def execute(simulation):
    simulation.InitializeSimulation()
    simulation.ConfigureStopTime(macros.sec2nano(SECONDS))
    simulation.ExecuteSimulation()


def time_bare_flight(flights):
    begun = time.perf_counter()
    for _ in range(flights):
        execute(Ascent())
    return (time.perf_counter() - begun) / flights


def time_campaign(flights, processes):
    campaign = Controller()
    campaign.setSimulationFunction(Ascent)
    campaign.setExecutionFunction(execute)
    campaign.setExecutionCount(flights)
    campaign.setShouldDisperseSeeds(True)
    campaign.setThreadCount(processes)
    campaign.setVerbose(False)
    campaign.setShowProgressBar(False)
    state = (
        ("craft.hub.r_CN_NInit", POSITION_M, 1000.0),
        ("craft.hub.v_CN_NInit", VELOCITY_M_S, 10.0),
    )
    for name, mean, sigma in state:
        campaign.addDispersion(NormalVectorCartDispersion(name, mean, [sigma] * 3))
    campaign.addDispersion(NormalDispersion("craft.hub.mHub", MASS_KG, 0.01 * MASS_KG))
    kept = RetentionPolicy()
    kept.addMessageLog("state", ["r_BN_N", "v_BN_N"])
    campaign.addRetentionPolicy(kept)
    with tempfile.TemporaryDirectory() as folder:
        campaign.setArchiveDir(f"{folder}/campaign")
        begun = time.perf_counter()
        failed = campaign.executeSimulations()
        seconds = time.perf_counter() - begun
    if failed:
        raise SystemExit(f"{len(failed)} flights failed")
    return seconds / flights


def main():
    flights, processes = (int(text) for text in sys.argv[1:3])
    bare = time_bare_flight(20)
    seconds = time_campaign(flights, processes)
    print(json.dumps({"flights_per_s": 1.0 / seconds, "bare_flights_per_s": 1.0 / bare}))


if __name__ == "__main__":
    main()
