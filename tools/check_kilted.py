# SPDX-License-Identifier: Apache-2.0
"""Check our settings of Fast DDS with Fast DDS 3, from the wheels of ROS 2 Kilted.

    ./ares exec python tools/check_kilted.py [FOLDER]

Makes an environment in FOLDER (a temporary one by default), starts a node in it with the profile
that a flight would set there, and returns 1 if the node prints a complaint. As a control, the
profile of Fast DDS 2 must cause one.
"""

import argparse
import os
import subprocess
import sys
import tempfile
import venv
from collections.abc import Mapping
from pathlib import Path

from ares_bringup.discovery import PROFILE, PROFILE_VARIABLES, discovery_settings

WHEELS = ("ros-kilted-rclpy==9.1.2", "ros-kilted-rmw-fastrtps-cpp==9.3.3")
NODE = """
import rclpy
from rcl_interfaces.msg import Log
rclpy.init()
rclpy.create_node("check_kilted").create_publisher(Log, "check_kilted", 1)
rclpy.shutdown()
print("done")
"""
#: ROS domain above those claimed by flights.
DOMAIN = "101"


def complaints(folder: Path, settings: Mapping[str, str]) -> str:
    """Return the output of a node started with these settings; "" if there is none.

    Raises:
        RuntimeError: it did not complete.
    """
    kept = {name: os.environ[name] for name in ("PATH", "HOME") if name in os.environ}
    environment = {"AMENT_PREFIX_PATH": str(folder), "ROS_DOMAIN_ID": DOMAIN, **kept, **settings}
    node = subprocess.run(
        [folder / "bin" / "python", "-c", NODE],
        env=environment,
        capture_output=True,
        text=True,
        check=False,
    )
    if "done" not in node.stdout:
        raise RuntimeError(f"the node ended with {node.returncode}: {node.stderr}")
    return node.stderr.strip()


def check(folder: Path) -> int:
    """Return 0, or 1 if the settings are not accepted."""
    python = str(folder / "bin" / "python")
    if not Path(python).exists():
        venv.create(folder, with_pip=True)
        install = [python, "-m", "pip", "install", "--quiet", "--disable-pip-version-check"]
        subprocess.run([*install, *WHEELS], check=True)
    settings = discovery_settings({"AMENT_PREFIX_PATH": str(folder)})
    said = complaints(folder, settings)
    control = complaints(folder, {PROFILE_VARIABLES[0]: str(PROFILE)})
    print(f"{', '.join(WHEELS)}: {said or 'the profile is taken'}")
    if not control:
        print("the control, a profile of Fast DDS 2, was taken too: this check tells nothing")
    return int(bool(said) or not control)


def main() -> int:
    """Make the environment and check it."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folder", nargs="?", type=Path, help="of the environment, kept if named")
    options = parser.parse_args()
    if options.folder:
        return check(options.folder.absolute())
    with tempfile.TemporaryDirectory(prefix="ares-kilted-") as folder:
        return check(Path(folder) / "environment")


if __name__ == "__main__":
    sys.exit(main())
