# SPDX-License-Identifier: Apache-2.0
"""Set up the ROS environment of a flight: security and discovery. No ROS."""

import os
from collections.abc import Mapping, MutableMapping
from pathlib import Path

from ares_bringup.options import CannotStart
from ares_node.security import RANGE, SecurityError, check_security

#: Variables by which a user gives Fast DDS a profile.
PROFILE_VARIABLES = ("FASTDDS_DEFAULT_PROFILES_FILE", "FASTRTPS_DEFAULT_PROFILES_FILE")

#: Equal settings for Fast DDS 2 (Jazzy) and 3 (Kilted), which renamed one of them.
PROFILE = Path(__file__).with_name("fastdds.xml")
PROFILE_3 = Path(__file__).with_name("fastdds3.xml")
#: Folder below the prefix of a ROS 2 that shows Fast DDS 3.
_FAST_DDS_3 = "share/fastdds"


def check_protection(environment: Mapping[str, str] = os.environ) -> None:
    """Refuse to start without the security that the environment requests.

    Raises:
        CannotStart: it is not available; one line.
    """
    try:
        check_security(environment)
    except SecurityError as error:
        raise CannotStart(str(error)) from error


def discovery_settings(environment: Mapping[str, str] = os.environ) -> dict[str, str]:
    """Return variables to add to an environment, without those that the user has set.

    Discovery is limited to this machine. Fast DDS gets a profile with more frequent announcements;
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
        CannotStart: security is requested but not available.
    """
    check_protection(environment)
    environment.update(discovery_settings(environment))
