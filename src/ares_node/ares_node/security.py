# SPDX-License-Identifier: Apache-2.0
"""Check that requested ROS security is available, so that nothing starts unprotected. No ROS.

rcl enables security only if ROS_SECURITY_ENABLE is exactly `true`, and a node without keys starts
unprotected unless ROS_SECURITY_STRATEGY is `Enforce`. Fast DDS of the wheels is built without its
security plugins and does not report that.
"""

import mmap
import os
from collections.abc import Iterator, Mapping, MutableMapping
from pathlib import Path

RANGE = "ROS_AUTOMATIC_DISCOVERY_RANGE"
ENABLE = "ROS_SECURITY_ENABLE"
STRATEGY = "ROS_SECURITY_STRATEGY"
KEYSTORE = "ROS_SECURITY_KEYSTORE"
ENCLAVE = "--enclave"
#: Path of the policies' enclaves, one per node by its name.
ENCLAVES = "/ares"

#: Name of the authentication plugin, contained in a library built with security.
_PLUGIN = b"builtin.PKI-DH"
_LIBRARY = "libfastrtps.so"


class SecurityError(RuntimeError):
    """Report requested security that is not available; the text is one line."""


def stay_on_this_machine(environ: MutableMapping[str, str] = os.environ) -> None:
    """Limit discovery to this machine unless the user has set its range."""
    if not environ.get(RANGE):
        environ[RANGE] = "LOCALHOST"


def is_asked_for(environ: Mapping[str, str] = os.environ) -> bool:
    """Return whether the user requests security, in any spelling."""
    return environ.get(ENABLE, "").strip().lower() not in ("", "0", "false", "no", "off")


def check_security(environ: Mapping[str, str] = os.environ) -> None:
    """Refuse to start unprotected if security is requested.

    Raises:
        SecurityError: it is not available, or would not be enforced.
    """
    if not is_asked_for(environ):
        return
    for name, expected in ((ENABLE, "true"), (STRATEGY, "Enforce")):
        if environ.get(name) != expected:
            raise SecurityError(f"{name} is {environ.get(name, '')!r}; expected {expected}")
    keystore = environ.get(KEYSTORE, "")
    if not keystore or not Path(keystore).is_dir():
        raise SecurityError(f"{KEYSTORE} is {keystore!r}; expected the folder of a keystore")
    middleware = environ.get("RMW_IMPLEMENTATION") or "rmw_fastrtps_cpp"
    if middleware.startswith("rmw_fastrtps") and not _has_plugins(environ):
        raise SecurityError(
            f"{ENABLE} is true, but this ROS 2 has no security: its Fast DDS was built without "
            "the plugins; a full ROS 2 Jazzy has them"
        )


def _has_plugins(environ: Mapping[str, str]) -> bool:
    return any(map(_holds_plugin, _libraries(environ)))


def _libraries(environ: Mapping[str, str]) -> Iterator[Path]:
    """List the files that Fast DDS may be loaded from."""
    prefixes = environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep)
    folders = [Path(prefix, "lib") for prefix in prefixes if prefix]
    folders += [Path(path) for path in environ.get("LD_LIBRARY_PATH", "").split(os.pathsep) if path]
    for folder in dict.fromkeys(folders):
        yield from sorted(folder.glob(_LIBRARY + "*"))
        # Debian has a folder per architecture
        yield from sorted(folder.glob("*/" + _LIBRARY + "*"))


def _holds_plugin(path: Path) -> bool:
    with path.open("rb") as file, mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as data:
        return data.find(_PLUGIN) >= 0


def enclave_arguments(node: str, given: list[str] | None = None) -> list[str]:
    """Return the ROS arguments for the enclave of a node; none without security.

    Args:
        node: name of the node, or of another enclave of the policies.
        given: arguments of the command line; an enclave in them has priority.
    """
    if not is_asked_for() or ENCLAVE in (given or ()):
        return []
    return ["--ros-args", ENCLAVE, f"{ENCLAVES}/{node}"]
