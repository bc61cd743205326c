# SPDX-License-Identifier: Apache-2.0
"""Access to a flight's messages; nothing starts unprotected without a message."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from ares_bringup.discovery import apply_discovery_settings, discovery_settings
from ares_bringup.options import CannotStart
from ares_node.security import (
    ENABLE,
    KEYSTORE,
    RANGE,
    STRATEGY,
    SecurityError,
    check_security,
    enclave_arguments,
    is_asked_for,
    stay_on_this_machine,
)

sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "tools"))
from policies import FILE, FLY, REPLAY, collect, document, read

NO_PLUGINS = "this ROS 2 has no security"


def asked(tmp_path: Path, **more: str) -> dict[str, str]:
    """Return the environment of a protected flight."""
    wanted = {ENABLE: "true", STRATEGY: "Enforce", KEYSTORE: str(tmp_path)}
    return {**os.environ, **wanted, **more}


@pytest.mark.parametrize("value", ["", "0", "false", "False", "no", "off"])
def test_security_that_is_not_asked_for(value: str) -> None:
    assert not is_asked_for({ENABLE: value})
    check_security({ENABLE: value})
    check_security({})


@pytest.mark.parametrize(
    ("wanted", "line"),
    [
        ({ENABLE: "1"}, f"{ENABLE} is '1'; expected true"),
        ({ENABLE: "TRUE"}, f"{ENABLE} is 'TRUE'; expected true"),
        ({ENABLE: "true"}, f"{STRATEGY} is ''; expected Enforce"),
        ({ENABLE: "true", STRATEGY: "Permissive"}, f"{STRATEGY} is 'Permissive'; expected Enforce"),
        ({ENABLE: "true", STRATEGY: "Enforce"}, f"{KEYSTORE} is ''; expected the folder"),
        (
            {ENABLE: "true", STRATEGY: "Enforce", KEYSTORE: "/nowhere"},
            f"{KEYSTORE} is '/nowhere'; expected the folder",
        ),
    ],
)
def test_half_of_security_is_refused(wanted: dict[str, str], line: str) -> None:
    with pytest.raises(SecurityError) as caught:
        check_security(wanted)
    assert str(caught.value).startswith(line)


def test_a_middleware_without_its_plugins_is_refused_and_one_with_them_is_not(
    tmp_path: Path,
) -> None:
    library = tmp_path / "lib" / "x86_64-linux-gnu" / "libfastrtps.so.2.14"
    library.parent.mkdir(parents=True)
    library.write_bytes(b"\x7fELF" + bytes(100))
    environ = asked(tmp_path, AMENT_PREFIX_PATH=str(tmp_path), LD_LIBRARY_PATH="")
    with pytest.raises(SecurityError, match=NO_PLUGINS):
        check_security(environ)
    library.write_bytes(b"\x7fELF" + bytes(100) + b"dds.sec.auth.builtin.PKI-DH\0")
    check_security(environ)
    # another middleware looks after itself: the strategy makes it refuse
    library.unlink()
    check_security(environ | {"RMW_IMPLEMENTATION": "rmw_cyclonedds_cpp"})


def test_a_process_takes_the_identity_of_its_node(monkeypatch: pytest.MonkeyPatch) -> None:
    assert enclave_arguments("guidance") == []
    monkeypatch.setenv(ENABLE, "true")
    assert enclave_arguments("guidance") == ["--ros-args", "--enclave", "/ares/guidance"]
    assert enclave_arguments("guidance", ["--ros-args", "--enclave", "/mine"]) == []


def full_install() -> bool:
    try:
        check_security(os.environ | {ENABLE: "true", STRATEGY: "Enforce", KEYSTORE: "/"})
    except SecurityError:
        return False
    return True


@pytest.mark.skipif(full_install(), reason="this ROS 2 has security")
@pytest.mark.parametrize(
    "words",
    [
        ("fly", "--no-record"),
        ("fly", "--no-record", "--in-process"),
        ("node", "sim"),
        ("live", "--no-browser"),
        ("replay", str(Path(__file__).parent.parent / "bags" / "reference")),
    ],
    ids=lambda words: " ".join(words[:3]),
)
def test_what_asks_for_security_on_the_wheels_does_not_start(
    ares, monkeypatch: pytest.MonkeyPatch, tmp_path: Path, words: tuple[str, ...]
) -> None:
    for name, value in asked(tmp_path).items():
        monkeypatch.setenv(name, value)
    done = ares(*words)
    assert (done.returncode, done.stdout) == (2, "")
    assert NO_PLUGINS in done.stderr
    assert done.stderr.count("\n") == 1


@pytest.mark.skipif(full_install(), reason="this ROS 2 has security")
def test_a_node_that_asks_for_security_on_the_wheels_does_not_start(tmp_path: Path) -> None:
    done = subprocess.run(
        [sys.executable, "-m", "ares_guidance"],
        env=asked(tmp_path),
        capture_output=True,
        text=True,
        check=False,
        timeout=120,
    )
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr.startswith("guidance: ROS_SECURITY_ENABLE is true, but this ROS 2 has no")
    assert done.stderr.count("\n") == 1


# ---- discovery


@pytest.mark.parametrize("given", [{}, {RANGE: ""}])
def test_discovery_stays_on_this_machine(given: dict[str, str]) -> None:
    environ = dict(given)
    stay_on_this_machine(environ)
    assert environ[RANGE] == "LOCALHOST"
    assert discovery_settings(given)[RANGE] == "LOCALHOST"
    environ = dict(given)
    apply_discovery_settings(environ)
    assert environ[RANGE] == "LOCALHOST"


def test_who_wants_more_of_discovery_says_so() -> None:
    environ = {RANGE: "SUBNET"}
    stay_on_this_machine(environ)
    apply_discovery_settings(environ)
    assert environ[RANGE] == "SUBNET"
    with pytest.raises(CannotStart, match="expected true"):
        apply_discovery_settings({ENABLE: "yes"})


# ---- policies


def test_the_policies_are_those_of_the_endpoints_that_nodes_create() -> None:
    found = collect()
    assert FILE.read_text(encoding="utf-8") == document(found)
    allowed = read(FILE.read_text(encoding="utf-8"))
    del allowed[REPLAY]
    assert allowed == found


def test_who_may_say_what() -> None:
    allowed = read(FILE.read_text(encoding="utf-8"))
    # in a domain of its own, in place of all that were recorded
    assert "/ares/nav_state" in allowed.pop(REPLAY).publish

    def may(kind: str, name: str) -> set[str]:
        return {node for node, lists in allowed.items() if name in getattr(lists, kind)}

    for topic in ("nav_state", "vehicle_state", "flight_event"):
        assert may("publish", f"/ares/{topic}") == {"vehicle_sim"}
    for topic in ("thrust_command", "guidance_status"):
        assert may("publish", f"/ares/{topic}") == {"guidance"}
    assert may("publish", "/clock") == {"vehicle_sim"}
    assert may("reply", "/ares/solve_trajectory") == {"optimizer"}
    assert may("request", "/ares/solve_trajectory") == {"guidance"}
    assert may("request", "/ares/vehicle_sim/set_parameters") == {"live"}
    # flight software hears navigation, never the truth
    assert "guidance" not in may("subscribe", "/ares/vehicle_state")
    assert may("subscribe", "/ares/thrust_command") == {"vehicle_sim", "recorder", "view"}
    for node in allowed:
        assert may("publish", f"/ares/{node}/transition_event") == {node}
    text = FILE.read_text(encoding="utf-8")
    assert all(f'path="/ares/{name}"' in text for name in (FLY, REPLAY))
