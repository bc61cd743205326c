# SPDX-License-Identifier: Apache-2.0
"""Topic names and QoS profiles of the graph.

The depth of the flight topics covers a reader that falls behind for a while: at lock-step rates of
some kHz the usual depth of 10 loses messages silently.
"""

from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy

from ares_node import names

NAMESPACE = names.NAMESPACE

NAV_STATE = "nav_state"
VEHICLE_STATE = "vehicle_state"
THRUST_COMMAND = "thrust_command"
GUIDANCE_STATUS = "guidance_status"
FLIGHT_EVENT = "flight_event"
FLIGHT_MEMBER = "flight_member"
CLOCK = names.CLOCK
DIAGNOSTICS = names.DIAGNOSTICS
TF = names.TF
TF_STATIC = names.TF_STATIC
FLIGHT_SEAL = "flight_seal"
#: Wall-clock facts. Not recorded: bags hold only data that is equal on every machine.
TIMING = "timing"
LOG = "/rosout"
SOLVE_TRAJECTORY = "solve_trajectory"
OPTIMIZE_TRAJECTORY = "optimize_trajectory"


def reliable(depth: int, *, keep_for_late: bool = False) -> QoSProfile:
    """Build a reliable keep-last profile of the given depth.

    `keep_for_late` makes it transient local: a late reader gets the last `depth` messages too.
    """
    return QoSProfile(
        history=HistoryPolicy.KEEP_LAST,
        depth=depth,
        reliability=ReliabilityPolicy.RELIABLE,
        durability=(
            DurabilityPolicy.TRANSIENT_LOCAL if keep_for_late else DurabilityPolicy.VOLATILE
        ),
    )


#: nav_state, vehicle_state, thrust_command, guidance_status: both ends.
FLIGHT = reliable(1000)
#: Profile of a viewer of these topics: the latest message, best effort.
LATEST = QoSProfile(
    history=HistoryPolicy.KEEP_LAST, depth=1, reliability=ReliabilityPolicy.BEST_EFFORT
)
#: flight_event: both ends.
EVENTS = reliable(100, keep_for_late=True)
#: flight_member: the last message of each writer; the reader gets those of all writers.
MEMBER = reliable(1, keep_for_late=True)
MEMBERS = reliable(100, keep_for_late=True)
#: /diagnostics, publishing side.
DIAGNOSTIC = reliable(1000)
#: /rosout, publishing side, as in every ROS 2 node.
LOG_QOS = reliable(1000, keep_for_late=True)
#: /clock, publishing side. Reliable serves best-effort readers (rclpy) and reliable ones.
CLOCK_QOS = reliable(10)
#: Recorder: deep enough for a whole flight of the default mission.
RECORDER = reliable(10_000)
#: Recorder on flight_event.
RECORDER_EVENTS = reliable(10_000, keep_for_late=True)
