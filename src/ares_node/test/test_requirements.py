# SPDX-License-Identifier: Apache-2.0
"""A package that is missing or too old gives one line."""

import subprocess
import sys
from importlib import metadata
from pathlib import Path

import pytest

from ares_node.requirements import missing_middleware, requirements, unmet

INSTALLED = {"numpy": "2.4.6", "pydantic": "1.10.14", "mcap": "1.6.0rc1"}
REQUIRED = {
    "ares_core": ["numpy>=2.0", "pydantic>=2.5", 'pytest; extra == "test"'],
    "ares_good": ["numpy>=2.0", "mcap>=1.6"],
    "ares_lacks": ["ares-good", "plotly>=5"],
    "ares_top": ["ares_core", "mcap"],
}


@pytest.fixture
def installed(monkeypatch: pytest.MonkeyPatch) -> None:
    def requires(name: str) -> list[str]:
        if name not in REQUIRED:
            raise metadata.PackageNotFoundError(name)
        return REQUIRED[name]

    def version(name: str) -> str:
        if name not in INSTALLED:
            raise metadata.PackageNotFoundError(name)
        return INSTALLED[name]

    monkeypatch.setattr(metadata, "requires", requires)
    monkeypatch.setattr(metadata, "version", version)


def refusal(package: str, environment: dict[str, str]) -> str:
    """Return the one line that a package's process ends with."""
    answer = subprocess.run(
        [sys.executable, "-m", package],
        env=environment,
        capture_output=True,
        text=True,
        check=False,
    )
    assert answer.returncode == 2
    assert answer.stdout == ""
    assert answer.stderr.count("\n") == 1
    return answer.stderr


@pytest.mark.usefixtures("installed")
def test_own_packages_are_followed_and_those_of_the_tests_are_not() -> None:
    assert dict(requirements("ares_top")) == {"mcap": "", "numpy": "2.0", "pydantic": "2.5"}


@pytest.mark.usefixtures("installed")
@pytest.mark.parametrize(
    ("package", "line"),
    [
        ("ares_good", None),
        ("ares_of_nobody", None),
        ("ares_top", 'pydantic 2.5 or newer, found 1.10.14; {} "pydantic>=2.5"'),
        ("ares_lacks", 'plotly 5 or newer, found none; {} "plotly>=5"'),
    ],
)
def test_the_line(package: str, line: str | None) -> None:
    advice = "install it, for example: pip install"
    assert unmet(package) == (line and f"needs the Python package {line.format(advice)}")


@pytest.mark.parametrize("package", ["ares_guidance", "ares_vehicle_sim", "ares_bringup"])
def test_a_process_says_it_and_ends(
    tmp_path: Path, ros_environment: dict[str, str], package: str
) -> None:
    """Put a distribution of another version in front of the installed one."""
    old = tmp_path / "numpy-1.26.4.dist-info"
    old.mkdir()
    (old / "METADATA").write_text("Metadata-Version: 2.1\nName: numpy\nVersion: 1.26.4\n")
    path = f"{tmp_path}:{ros_environment.get('PYTHONPATH', '')}"
    line = refusal(package, {**ros_environment, "PYTHONPATH": path})
    assert "needs the Python package numpy 2.0 or newer, found 1.26.4" in line


def test_a_middleware_that_is_not_installed(tmp_path: Path) -> None:
    registered = tmp_path / "share" / "ament_index" / "resource_index" / "rmw_typesupport"
    registered.mkdir(parents=True)
    for name in ("rmw_fastrtps_cpp", "rmw_implementation"):
        (registered / name).touch()
    prefix = {"AMENT_PREFIX_PATH": f"/none:{tmp_path}"}
    assert missing_middleware(prefix) is None
    assert missing_middleware({**prefix, "RMW_IMPLEMENTATION": "rmw_fastrtps_cpp"}) is None
    assert missing_middleware({**prefix, "RMW_IMPLEMENTATION": "rmw_cyclonedds_cpp"}) == (
        "RMW_IMPLEMENTATION is 'rmw_cyclonedds_cpp'; expected one that is installed: "
        "rmw_fastrtps_cpp"
    )


@pytest.mark.parametrize("package", ["ares_guidance", "ares_bringup"])
def test_a_process_without_its_middleware_says_it_and_ends(
    ros_environment: dict[str, str], package: str
) -> None:
    line = refusal(package, {**ros_environment, "RMW_IMPLEMENTATION": "rmw_of_nobody"})
    assert "RMW_IMPLEMENTATION is 'rmw_of_nobody'" in line
