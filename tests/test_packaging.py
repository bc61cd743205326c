# SPDX-License-Identifier: Apache-2.0
"""package.xml and requirements/ declare what the sources import."""

import ast
import json
import re
import runpy
import subprocess
import sys
from functools import cache
from itertools import pairwise
from pathlib import Path
from xml.etree import ElementTree

import pytest

ROOT = Path(__file__).parent.parent
PACKAGES = sorted(path.parent for path in ROOT.glob("src/*/setup.py"))
REQUIREMENTS = sorted((ROOT / "requirements").glob("*.txt"))

# import name -> key of rosdep, where they differ
KEYS = {
    "llvmlite": "python3-numba",
    "mcap": "mcap-ros2-support",
    "mcap_ros2": "mcap-ros2-support",
    "pydantic_core": "python3-pydantic",
    "yaml": "python3-yaml",
    "rosbags": "python3-rosbags-pip",
    "markupsafe": "python3-jinja2",
    "zstandard": "mcap-ros2-support",
} | {
    name: f"python3-{name}"
    for name in ("hypothesis", "jinja2", "matplotlib", "numba", "numpy", "pydantic", "pyproj")
    + ("pytest", "rich", "scipy", "tornado", "typer")
}
# rosdep knows no key for these: installed with pip
NO_KEY = {"distributed", "foxglove", "ipyopt", "plotly", "pyarrow", "pymsis"}
# import name -> name in the package index, where they differ
DISTRIBUTIONS = {
    "foxglove": "foxglove-sdk",
    "llvmlite": "numba",
    "mcap_ros2": "mcap-ros2-support",
    "pydantic_core": "pydantic",
    "yaml": "PyYAML",
}
MESSAGE = re.compile(r"([a-z]\w*_msgs)/(?:msg|srv)/[A-Z]\w*$")
# come with a distribution that is listed under another name
COMES_WITH = {
    "foxglove": "foxglove-sdk",
    "mcap-ros2": "mcap-ros2-support",
    "yaml": "pyyaml",
    "pydantic-core": "pydantic-core",
}


@cache
def imported(module: Path) -> set[str]:
    """Return the top-level names of all imports of a module."""
    nodes = list(ast.walk(ast.parse(module.read_text())))
    plain = [alias.name for node in nodes if isinstance(node, ast.Import) for alias in node.names]
    parts = [node.module for node in nodes if isinstance(node, ast.ImportFrom) and node.module]
    return {name.split(".")[0] for name in plain + parts}


def named_types(module: Path) -> set[str]:
    """Return the packages of message types that a module looks up by name."""
    nodes = ast.walk(ast.parse(module.read_text()))
    texts = [node.value for node in nodes if isinstance(node, ast.Constant)]
    found = [MESSAGE.match(text) for text in texts if isinstance(text, str)]
    return {match[1] for match in found if match}


def keys(names: set[str], own: str) -> set[str]:
    foreign = names - set(sys.stdlib_module_names) - NO_KEY - {own}
    return {KEYS.get(name, name) for name in foreign}


def declared(package: Path, *kinds: str) -> set[str]:
    manifest = ElementTree.parse(package / "package.xml").getroot()
    return {element.text for kind in kinds for element in manifest.findall(kind)}


def modules(package: Path) -> list[Path]:
    own = (package / package.name).rglob("*.py")
    return [path for path in [*own, *package.glob("launch/*.py")] if path.parent.name != "testing"]


def modules_for_tests(package: Path) -> list[Path]:
    return [*(package / "test").rglob("*.py"), *(package / package.name).glob("testing/*.py")]


@pytest.mark.parametrize("package", PACKAGES, ids=lambda path: path.name)
def test_package_xml_lists_what_the_modules_import(package):
    needed = set().union(
        *(keys(imported(x) | named_types(x), package.name) for x in modules(package))
    )
    listed = declared(package, "depend", "exec_depend")
    assert needed <= listed


@pytest.mark.parametrize("package", PACKAGES, ids=lambda path: path.name)
def test_package_xml_lists_what_the_tests_import(package):
    tests = modules_for_tests(package)
    # it depends on all packages: colcon would find a circle if they named it
    helpers = {path.stem for path in tests} | ({"ares_trials"} - {package.name})
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


def same_name(line: str) -> str:
    """Normalize the name in `name==version` as an index does."""
    name, version = line.split("==")
    return f"{re.sub(r'[-_.]+', '-', name).lower()}=={version}"


def test_what_is_installed_is_what_is_pinned():
    """Check the hashes written by `make lock`."""
    locked = {path.name: path for path in (ROOT / "requirements" / "locked").glob("*.txt")}
    for path in REQUIREMENTS:
        if path.name == "bench.txt":
            continue
        text = locked.pop(path.name).read_text()
        lines = path.read_text().splitlines()
        asked = {same_name(line) for line in lines if "==" in line}
        found = re.findall(r"^(\S+==\S+)(?= )", text, re.MULTILINE)
        assert {same_name(line) for line in found} == asked, path.name
        assert text.count("--hash=sha256:") >= len(found)
    assert not locked


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


def setup_keywords(package: Path, monkeypatch) -> dict:
    given = {}
    monkeypatch.chdir(package)
    monkeypatch.setattr("setuptools.setup", lambda **keywords: given.update(keywords))
    runpy.run_path("setup.py")
    return given


def required(package: Path, monkeypatch) -> list[str]:
    """Return a package's requirements, including its extras solve, live and pages."""
    given = setup_keywords(package, monkeypatch)
    extras = given["extras_require"]
    return [
        *given.get("install_requires", []),
        *{*extras.get("solve", []), *extras.get("live", []), *extras.get("pages", [])},
    ]


def from_the_index(package: Path) -> set[str]:
    """Return the distributions of the package index that the modules import, in lower case."""
    names = set().union(*(imported(module) for module in modules(package)))
    foreign = {DISTRIBUTIONS.get(name, name).lower() for name in names - {package.name}}
    return foreign & {name.lower() for name in pins()}


def numbers(version: str) -> tuple[int, ...]:
    return tuple(int(part) for part in re.findall(r"\d+", version))


@pytest.mark.parametrize("package", PACKAGES, ids=lambda path: path.name)
def test_setup_requires_what_the_modules_import(package, monkeypatch):
    lines = required(package, monkeypatch)
    foreign = dict(line.split(">=") for line in lines if not line.startswith("ares_"))
    assert {name.lower() for name in foreign} == from_the_index(package)
    pinned = {name.lower(): version for name, version in pins().items()}
    for name, least in foreign.items():
        assert numbers(least) <= numbers(pinned[name.lower()])
    own = {line for line in lines if line.startswith("ares_")}
    assert own == {
        name
        for name in declared(package, "exec_depend")
        if name.startswith("ares_") and name != "ares_msgs"
    }


def test_the_install_page_names_every_requirement(monkeypatch):
    page = (ROOT / "docs" / "install.md").read_text()
    rows = dict(re.findall(r"^\| (`[^|]+`) \| ([\d., ]+) \|", page, re.MULTILINE))
    told = {
        name: least
        for names, versions in rows.items()
        for name, least in zip(re.findall(r"`([^`]+)`", names), versions.split(", "), strict=True)
    }
    lines = [line for package in PACKAGES for line in required(package, monkeypatch)]
    assert told == dict(line.split(">=") for line in lines if ">=" in line)
    without_key = {name for name in told if re.search(rf"`{name}` .*\| no key", page)}
    assert without_key == {DISTRIBUTIONS.get(name, name) for name in NO_KEY}


@pytest.mark.parametrize("package", PACKAGES, ids=lambda path: path.name)
def test_colcon_finds_the_tests(package, monkeypatch):
    """Check setup.py: colcon runs pytest only if declared there, and else reports success."""
    assert "pytest" in setup_keywords(package, monkeypatch)["extras_require"]["test"]
    assert "python3-pytest-timeout" in declared(package, "test_depend")
    assert list((package / "test").glob("test_*.py"))


@pytest.mark.parametrize("package", PACKAGES, ids=lambda path: path.name)
def test_setup_installs_every_file_of_the_package(package, monkeypatch):
    given = setup_keywords(package, monkeypatch)
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
    for files in ("launch/*.py", "layouts/*", "params/*", "rviz/*"):
        assert {f"{path.parent.name}/{path.name}" for path in package.glob(files)} <= shared


def test_the_containers_have_what_the_readme_asks_for():
    steps = (ROOT / "Dockerfile").read_text()
    container = json.loads((ROOT / ".devcontainer" / "devcontainer.json").read_text())
    assert f" AS {container['build']['target']}\n" in steps
    installed = re.search(r"--no-install-recommends \\\n(.*?) \\\n", steps, re.DOTALL)[1].split()
    listed = (ROOT / "requirements" / "apt.list").read_text().splitlines()
    browser = {line for line in listed if line and not line.startswith("#")}
    assert browser | {"gcc", "g++", "make"} <= set(installed)
    # what git ignores is not copied, the reference flight is
    copied = (ROOT / ".dockerignore").read_text().splitlines()
    assert {".venv", "build", "install", "bags/*", "!bags/reference"} <= set(copied)


MANIFESTS = sorted(ROOT.glob("src/*/package.xml"))
SPDX = "SPDX-License-Identifier: Apache-2.0"
#: How a source file's comment begins and ends, by the end of its name.
COMMENTS = {
    ".py": ("# ", ""),
    ".js": ("// ", ""),
    ".css": ("/* ", " */"),
    "CMakeLists.txt": ("# ", ""),
}
#: Sources that have no such end.
SCRIPTS = ("ares", "tools/real_launch", "tests/stand_ins/ros2")


def sources() -> dict[str, tuple[str, str]]:
    """Return the project's source files by path, with their comment marks."""
    command = ["git", "ls-files"]
    listed = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    if listed.returncode:
        pytest.skip("not a checkout: " + listed.stderr.strip())
    names = [name for name in listed.stdout.splitlines() if (ROOT / name).exists()]
    ends = {name: next(filter(name.endswith, COMMENTS), "") for name in names}
    marks = {name: COMMENTS[end] for name, end in ends.items() if end}
    return marks | dict.fromkeys(SCRIPTS, ("# ", ""))


def test_each_source_file_names_its_licence_on_one_line():
    assert "Apache License" in (ROOT / "LICENSE").read_text()
    found = sources()
    assert len(found) > 600
    unlicensed = []
    for name, (begin, end) in found.items():
        lines = (ROOT / name).read_text().splitlines()
        first = [line for line in lines[:2] if not line.startswith("#!")]
        if first[:1] != [f"{begin}{SPDX}{end}"]:
            unlicensed.append(name)
    assert unlicensed == []


def test_all_packages_carry_one_version_before_the_first():
    versions = {next(iter(declared(path.parent, "version"))) for path in MANIFESTS}
    assert len(MANIFESTS) == 12
    (version,) = versions
    assert re.fullmatch(r"0\.\d+\.\d+", version)
    for package in PACKAGES:
        assert f'version="{version}"' in (package / "setup.py").read_text(), package.name


@pytest.mark.parametrize("manifest", MANIFESTS, ids=lambda path: path.parent.name)
def test_a_package_has_a_changelog_and_an_author(manifest):
    package = manifest.parent
    lines = (package / "CHANGELOG.rst").read_text().splitlines()
    title = f"Changelog for package {package.name}"
    assert lines[:3] == ["^" * len(title), title, "^" * len(title)]
    headings = [above for above, line in pairwise(lines) if set(line) == {"-"}]
    (version,) = declared(package, "version")
    assert re.fullmatch(rf"Forthcoming|{re.escape(version)} \(\d{{4}}-\d\d-\d\d\)", headings[0])
    assert any(line.startswith("* ") for line in lines)
    assert declared(package, "author") == {"Ares maintainers"}
    # the tree knows no address where the project is to be found
    assert declared(package, "url") == set()
