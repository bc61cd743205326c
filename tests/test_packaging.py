"""package.xml and requirements/ say what the sources need."""

import ast
import re
import runpy
import sys
from pathlib import Path
from xml.etree import ElementTree

import pytest

ROOT = Path(__file__).parent.parent
PACKAGES = sorted(path.parent for path in ROOT.glob("src/*/setup.py"))
REQUIREMENTS = sorted((ROOT / "requirements").glob("*.txt"))

# import name -> key of rosdep, where they differ
KEYS = {
    "mcap": "mcap-ros2-support",
    "mcap_ros2": "mcap-ros2-support",
    "pydantic_core": "python3-pydantic",
    "yaml": "python3-yaml",
    "rosbags": "python3-rosbags-pip",
    "markupsafe": "python3-jinja2",
} | {
    name: f"python3-{name}"
    for name in ("hypothesis", "jinja2", "matplotlib", "numba", "numpy", "pydantic", "pytest")
    + ("rich", "scipy", "typer")
}
# rosdep knows no key for these: installed with pip
NO_KEY = {"distributed", "plotly", "pyarrow", "pymsis"}
# come with a distribution that is listed under another name
COMES_WITH = {"mcap-ros2": "mcap-ros2-support", "yaml": "pyyaml", "pydantic-core": "pydantic-core"}


def imported(module: Path) -> set[str]:
    """Top-level names of everything that a module imports."""
    nodes = list(ast.walk(ast.parse(module.read_text())))
    plain = [alias.name for node in nodes if isinstance(node, ast.Import) for alias in node.names]
    parts = [node.module for node in nodes if isinstance(node, ast.ImportFrom) and node.module]
    return {name.split(".")[0] for name in plain + parts}


def keys(names: set[str], own: str) -> set[str]:
    foreign = names - set(sys.stdlib_module_names) - NO_KEY - {own}
    return {KEYS.get(name, name) for name in foreign}


def declared(package: Path, *kinds: str) -> set[str]:
    manifest = ElementTree.parse(package / "package.xml").getroot()
    return {element.text for kind in kinds for element in manifest.findall(kind)}


def modules(package: Path) -> list[Path]:
    own = (package / package.name).rglob("*.py")
    return [path for path in [*own, *package.glob("launch/*.py")] if path.name != "testing.py"]


def modules_for_tests(package: Path) -> list[Path]:
    return [*(package / "test").rglob("*.py"), *(package / package.name).glob("testing.py")]


@pytest.mark.parametrize("package", PACKAGES, ids=lambda path: path.name)
def test_package_xml_lists_what_the_modules_import(package):
    needed = set().union(*(keys(imported(module), package.name) for module in modules(package)))
    listed = declared(package, "depend", "exec_depend")
    assert needed <= listed


@pytest.mark.parametrize("package", PACKAGES, ids=lambda path: path.name)
def test_package_xml_lists_what_the_tests_import(package):
    tests = modules_for_tests(package)
    helpers = {path.stem for path in tests}
    needed = set().union(*(keys(imported(test) - helpers, package.name) for test in tests))
    assert needed <= declared(package, "depend", "exec_depend", "test_depend")


@pytest.mark.parametrize("package", PACKAGES, ids=lambda path: path.name)
def test_package_is_registered_with_ament(package):
    assert (package / "resource" / package.name).exists()
    assert declared(package, "name") == {package.name}
    assert declared(package, "license") == {"Apache-2.0"}


def pins() -> dict[str, str]:
    lines = [line for path in REQUIREMENTS for line in path.read_text().splitlines()]
    return dict(line.split("==") for line in lines if line and not line.startswith("#"))


def test_every_requirement_is_pinned_once():
    names = []
    for path in REQUIREMENTS:
        for line in path.read_text().splitlines():
            if line and not line.startswith("#"):
                assert re.fullmatch(r"[A-Za-z0-9._-]+==[A-Za-z0-9.]+", line), f"{path.name}: {line}"
                names.append(line.split("==")[0].lower().replace("_", "-"))
    assert len(names) == len(set(names))


def test_everything_imported_is_pinned():
    pinned = {name.lower().replace("_", "-") for name in pins()}
    ros = {"ament_index_python", "launch", "launch_ros", "ares_msgs"}
    ros |= {"rclpy", "rcl_interfaces", "lifecycle_msgs"}
    for package in PACKAGES:
        for module in (package / package.name).rglob("*.py"):
            names = imported(module) - set(sys.stdlib_module_names) - ros
            for name in sorted(x for x in names if not x.startswith("ares_")):
                if not name.endswith(("_msgs", "_interfaces")):
                    found = name.replace("_", "-")
                    assert COMES_WITH.get(found, found) in pinned, f"{module}: {name}"


@pytest.mark.parametrize("package", PACKAGES, ids=lambda path: path.name)
def test_setup_installs_every_file_of_the_package(package, monkeypatch):
    given = {}
    monkeypatch.chdir(package)
    monkeypatch.setattr("setuptools.setup", lambda **keywords: given.update(keywords))
    runpy.run_path("setup.py")
    home = package / package.name
    patterns = given["package_data"][package.name]
    installed = {path for pattern in patterns for path in home.glob(pattern)}
    present = {path for path in home.rglob("*") if path.is_file() and path.suffix != ".py"}
    assert {path for path in present if "__pycache__" not in path.parts} <= installed
    with_code = {path.parent for path in home.rglob("*.py")}
    assert {".".join(path.relative_to(package).parts) for path in with_code} == set(
        given["packages"]
    )
    shared = {name for _, names in given["data_files"] for name in names}
    assert {f"{path.parent.name}/{path.name}" for path in package.glob("launch/*.py")} <= shared
    assert {f"{path.parent.name}/{path.name}" for path in package.glob("params/*")} <= shared
