# SPDX-License-Identifier: Apache-2.0
"""A larger system: two flights, a foreign node, and a reader of all topics.

ros2 launch two_flights.launch.py bags:=FOLDER ports:=PORT,PORT
"""

import sys
from pathlib import Path

from ament_index_python.packages import get_package_share_directory
from launch import LaunchDescription
from launch.actions import (
    DeclareLaunchArgument,
    ExecuteProcess,
    IncludeLaunchDescription,
    OpaqueFunction,
)
from launch.substitutions import LaunchConfiguration

HERE = Path(__file__).parent
FLIGHT = Path(get_package_share_directory("ares_bringup"), "launch", "flight.launch.py")


def system(context):
    bags = LaunchConfiguration("bags").perform(context)
    ports = LaunchConfiguration("ports").perform(context).split(",")
    flights = [
        IncludeLaunchDescription(
            str(FLIGHT),
            launch_arguments=[
                ("namespace", namespace),
                ("bag", f"{bags}/{namespace}"),
                ("live", "true"),
                ("foxglove_port", port),
            ],
        )
        for namespace, port in zip(("east", "west"), ports, strict=True)
    ]
    others = [
        ExecuteProcess(cmd=[sys.executable, str(HERE / name)], output="screen")
        for name in ("other_node.py", "read_all.py")
    ]
    # one before the flights, whose settings it must not get, and one behind them
    return [others[0], *flights, others[1]]


def generate_launch_description():
    return LaunchDescription(
        [
            DeclareLaunchArgument("bags", default_value=".", description="Folder of the bags."),
            DeclareLaunchArgument(
                "ports", default_value="8765,8766", description="Ports for Foxglove."
            ),
            OpaqueFunction(function=system),
        ]
    )
