# SPDX-License-Identifier: Apache-2.0
"""ROS environment of a flight: who may join, and how fast nodes find each other. No ROS."""

import os
from collections.abc import Mapping, MutableMapping
from pathlib import Path

from ares_bringup.options import CannotStart
from ares_node.security import RANGE, SecurityError, check_security

#: Where Fast DDS looks for settings of the user's own.
PROFILE_VARIABLES = ("FASTDDS_DEFAULT_PROFILES_FILE", "FASTRTPS_DEFAULT_PROFILES_FILE")

#: The same settings for Fast DDS 2, as of Jazzy, and 3, as of Kilted, which renamed one of them.
PROFILE = Path(__file__).with_name("fastdds.xml")
PROFILE_3 = Path(__file__).with_name("fastdds3.xml")
#: What Fast DDS 3 has below the prefix of a ROS 2; Fast DDS 2 is called otherwise.
_FAST_DDS_3 = "share/fastdds"


def check_protection(environment: Mapping[str, str] = os.environ) -> None:
    """Refuse to start without the security that is asked for.

    Raises:
        CannotStart: it cannot be had; one line.
    """
    try:
        check_security(environment)
    except SecurityError as error:
        raise CannotStart(str(error)) from error


def discovery_settings(environment: Mapping[str, str] = os.environ) -> dict[str, str]:
    """Variables to add to an environment; what the user has set stays.

    Discovery stays on this machine. Fast DDS gets a profile by which it announces more often;
    other middleware does not read it.
    """
    settings = {}
    if not environment.get(RANGE):
        settings[RANGE] = "LOCALHOST"
    if not any(environment.get(name) for name in PROFILE_VARIABLES):
        prefixes = environment.get("AMENT_PREFIX_PATH", "").split(os.pathsep)
        third = any(Path(prefix, _FAST_DDS_3).is_dir() for prefix in prefixes if prefix)
        fastdds, fastrtps = PROFILE_VARIABLES
        settings |= {fastdds: str(PROFILE_3)} if third else {fastrtps: str(PROFILE)}
    return settings


def apply_discovery_settings(environment: MutableMapping[str, str] = os.environ) -> None:
    """Add the settings to an environment, before its first ROS context is made.

    Raises:
        CannotStart: security is asked for, which cannot be had.
    """
    check_protection(environment)
    environment.update(discovery_settings(environment))
