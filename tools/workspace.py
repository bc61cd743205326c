# SPDX-License-Identifier: Apache-2.0
"""Prepare the workspace, then run the project's command line in it.

Needs only a Python with its standard library and a compiler. It makes:

    .venv/          Python packages: ROS 2 Jazzy wheels (unless a sourced Jazzy is used), build
                    tools and the requirements of flying, all pinned in requirements/; those of
                    pages and tests are added by the first verb that needs them
    build/ install/ the colcon workspace of src/
    build/kernels/  machine code of the numeric kernels, one folder per state of their sources;
                    a flight compiles its own law, other verbs compile all

Each part has a stamp, written last, with a digest of its inputs. A part whose stamp is missing or
differs is made again, so that an interruption at any point is repaired by the next call. A lock
keeps two calls from preparing at the same time.
"""

import contextlib
import dataclasses
import fcntl
import hashlib
import importlib.util
import json
import os
import re
import shlex
import shutil
import subprocess
import sys
import sysconfig
import time
from collections.abc import Iterable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
sys.path[:0] = [str(ROOT / "src" / name) for name in ("ares_models", "ares_bringup")]
# standard library only
from ares_bringup import usage  # noqa: E402
from ares_models import kernel_cache  # noqa: E402

sys.path.insert(0, str(ROOT / "tools"))
from progress import BAR, Steps, say  # noqa: E402

ROS_DISTRO = "jazzy"
PYTHONS = ((3, 11), (3, 12), (3, 13))
# Increment to remake everything after a change of this file.
GENERATION = "2"

INSTALLER = "uv.txt"
ROS_REQUIREMENTS = ("ros-jazzy.txt",)
REQUIREMENTS = ("build.txt", "fly.txt")
#: Additional requirements of some verbs, each list with its own stamp.
EVERYTHING = ("solve.txt", "live.txt", "pages.txt", "dev.txt")
#: Requirements of campaigns, pages and plots.
PAGES = ("solve.txt", "live.txt", "pages.txt")
ALSO = {
    "aborts": PAGES,
    "env": EVERYTHING,
    "exec": EVERYTHING,
    "export": PAGES,
    "live": ("live.txt",),
    "montecarlo": PAGES,
    "node": ("solve.txt",),
    "optimize": ("solve.txt",),
    "plot": PAGES,
    "prepare": EVERYTHING,
    "report": PAGES,
    "reproduce": PAGES,
    "test": EVERYTHING,
}
#: Options of a flight that may need the optimizer or dispersions.
SOLVED_FOR = re.compile(r"--(mission|guidance|initial-guess|dispersions|flight)(=.*)?")
#: Options of a flight with a Foxglove server.
SHOWN_BY = re.compile(r"--foxglove(-port)?(=.*)?")
#: Kernels needed by a verb: all, none, or those of a flight by a law, given by its name.
ALL_KERNELS = "all"
NO_KERNELS = ""
FEW_KERNELS = (
    *("bag", "dispersions", "env", "export", "live", "missions", "plot", "replay", "report"),
)
#: Law whose kernels are compiled while the messages are built, since it needs no registry.
FIRST_LAW = "peg"
COMPILING = {True: "once, until they change: a minute", False: "once, half a minute"}
#: Steps of the preparation, with their duration on an idle machine of two cores, s.
PACKAGES, ADDITIONS = "Python packages", "further packages"
BUILDING, KERNELS = "messages", "kernels"
LENGTHS = {PACKAGES: 25.0, ADDITIONS: 20.0, BUILDING: 30.0, KERNELS: 30.0}
ALL_KERNELS_LENGTH = 75.0
#: Further steps: wait for another call's preparation; install a browser, with its duration, s.
OTHERS, BROWSER = "another call", "a browser"
BROWSER_LENGTH = 15.0

#: Verbs of the workspace: arguments and help.
VERBS = {
    "prepare": ("", "make the workspace ready, nothing else"),
    "exec": ("COMMAND ...", "run a command in the prepared environment"),
    "env": ("", 'print that environment for a shell: eval "$(./ares env)"'),
    "test": ("[ARG ...]", "linters, type checker and all tests; arguments go to pytest"),
}


class WorkspaceError(Exception):
    """Report in one line that the workspace cannot be prepared."""


# --- digests of the parts ----------------------------------------------------------------


def digest(parts: Iterable[str | bytes]) -> str:
    """Hash a sequence of texts, including their boundaries."""
    state = hashlib.sha256()
    for part in parts:
        raw = part.encode() if isinstance(part, str) else part
        state.update(b"%d:" % len(raw))
        state.update(raw)
    return state.hexdigest()[:16]


def _files(folder: Path) -> list[Path]:
    """List all files below a folder, sorted, without caches and hidden files."""
    return sorted(
        path
        for path in folder.rglob("*")
        if path.is_file()
        and not any(
            part.startswith(".") or part == "__pycache__" or part.endswith(".egg-info")
            for part in path.relative_to(folder).parts
        )
    )


def packages(root: Path) -> list[Path]:
    """List the folders of the packages in src/."""
    return sorted(path.parent for path in root.glob("src/*/package.xml"))


def interfaces(root: Path) -> list[Path]:
    """List the folders of the messages that every full ROS 2 has but no wheel contains."""
    return sorted(path.parent for path in root.glob("tools/interfaces/*/package.xml"))


def environment_digest(root: Path, python: str, ros: str) -> str:
    """Hash the inputs of .venv.

    Args:
        root: top of the project.
        python: version, such as "3.12".
        ros: prefix of the sourced ROS 2; "": the wheels.
    """
    names = REQUIREMENTS if ros else ROS_REQUIREMENTS + REQUIREMENTS
    pins = [lock_file(root, name).read_bytes() for name in (INSTALLER, *names)]
    return digest([GENERATION, str(root), python, ros, *pins])


def lock_file(root: Path, name: str) -> Path:
    """Return the path of a list of requirements with hashes."""
    return root / "requirements" / "locked" / name


def interface_digest(root: Path, environment: str) -> str:
    """Hash the inputs that require a complete rebuild.

    They are the sources of the compiled (CMake) packages, and the list of packages.
    """
    parts: list[str | bytes] = [GENERATION, environment]
    found = [*packages(root), *interfaces(root)]
    parts += [package.name for package in found]
    for package in found:
        if (package / "CMakeLists.txt").exists():
            for path in _files(package):
                parts += [path.relative_to(root).as_posix(), path.read_bytes()]
    return digest(parts)


def package_digest(root: Path) -> str:
    """Hash the inputs of the installed layout of the Python packages.

    Their modules are linked, not copied: an edit needs no rebuild.
    """
    parts: list[str | bytes] = []
    for package in packages(root):
        for name in ("package.xml", "setup.py", "setup.cfg"):
            if (package / name).exists():
                parts += [f"{package.name}/{name}", (package / name).read_bytes()]
        # each module with a law is an entry point
        laws = f"{package.name}/laws"
        for folder in ("launch", "layouts", "params", "resource", "rviz", laws):
            parts += [path.relative_to(root).as_posix() for path in _files(package / folder)]
    return digest(parts)


def kernel_digest(root: Path) -> str:
    """Hash the modules with kernels and all project modules they import."""
    texts: dict[str, str] = {}
    for package in packages(root):
        texts |= kernel_cache.read_package(package / package.name)
    return kernel_cache.state_of(texts)


# --- prerequisites -----------------------------------------------------------------------


def find_compiler(variable: str, names: Sequence[str], environ: Mapping[str, str]) -> str | None:
    """Return the path of the compiler named by ``variable`` or, if unset, by one of ``names``."""
    words = shlex.split(environ.get(variable, ""))
    for name in words[:1] or names:
        found = shutil.which(name, path=environ.get("PATH", os.defpath))
        if found:
            return found
    return None


def check_prerequisites(environ: Mapping[str, str]) -> None:
    """Raise WorkspaceError, with what to install, if a prerequisite is missing."""
    python = f"python{sys.version_info[0]}.{sys.version_info[1]}"
    if not find_compiler("CC", ("cc", "gcc", "clang"), environ):
        raise WorkspaceError(
            "no C compiler found (cc, gcc, clang or $CC): install one,"
            " for example `apt install build-essential`"
        )
    if not find_compiler("CXX", ("c++", "g++", "clang++"), environ):
        raise WorkspaceError(
            "no C++ compiler found (c++, g++, clang++ or $CXX), which ROS 2 messages need:"
            " install one, for example `apt install build-essential`"
        )
    if not (Path(sysconfig.get_path("include")) / "Python.h").exists():
        raise WorkspaceError(
            f"{python} has no header files: install them, for example `apt install {python}-dev`"
        )
    if not importlib.util.find_spec("ensurepip") or not importlib.util.find_spec("venv"):
        raise WorkspaceError(
            f"{python} cannot make virtual environments: install that part of it,"
            f" for example `apt install {python}-venv`"
        )


# --- a sourced ROS 2 -----------------------------------------------------------------------


def sourced_ros(root: Path, environ: Mapping[str, str]) -> str:
    """Return the prefix of the ROS 2 Jazzy sourced in ``environ``; "" without one."""
    if environ.get("ROS_DISTRO") != ROS_DISTRO:
        return ""
    for prefix in split_path(environ.get("AMENT_PREFIX_PATH", "")):
        if Path(prefix, "share/rclpy/package.xml").exists() and Path(prefix) != root / ".venv":
            return prefix
    return ""


def ros_paths(environ: Mapping[str, str]) -> dict[str, str]:
    """Return the entries that a sourced ROS 2 has added to the search paths."""
    prefixes = split_path(environ.get("AMENT_PREFIX_PATH", ""))
    added = {
        name: [entry for entry in split_path(environ.get(name, "")) if _below(entry, prefixes)]
        for name in SEARCH_PATHS
    }
    return {name: os.pathsep.join(entries) for name, entries in added.items() if entries}


def find_ros_python(environ: Mapping[str, str]) -> str | None:
    """Return a Python that can import the sourced ROS 2's rclpy, this one if possible."""
    candidates = [base_python()]
    if not environ.get("PYTHON"):
        candidates += ["python3", "/usr/bin/python3"]
    test = f"import sys, rclpy; assert sys.version_info[:2] in {PYTHONS!r}; print(sys.executable)"
    for candidate in candidates:
        with contextlib.suppress(OSError):
            answer = subprocess.run(
                [candidate, "-c", test],
                env=dict(environ),
                capture_output=True,
                text=True,
                check=False,
            )
            if answer.returncode == 0:
                return answer.stdout.strip()
    return None


def base_python() -> str:
    """Return the interpreter of this process, outside of any virtual environment."""
    base = getattr(sys, "_base_executable", None)
    return str(base or sys.executable)


# --- the environment -----------------------------------------------------------------------


def split_path(value: str) -> list[str]:
    """Return the non-empty entries of a search path."""
    return [entry for entry in value.split(os.pathsep) if entry]


def _below(entry: str, prefixes: Iterable[str]) -> bool:
    return any(entry == prefix or entry.startswith(prefix + os.sep) for prefix in prefixes)


def _without(value: str, prefixes: Sequence[str]) -> str:
    return os.pathsep.join(x for x in split_path(value) if not _below(x, prefixes))


SEARCH_PATHS = ("PATH", "PYTHONPATH", "LD_LIBRARY_PATH", "AMENT_PREFIX_PATH", "CMAKE_PREFIX_PATH")


def without_other_clone(environ: Mapping[str, str], root: Path) -> dict[str, str]:
    """Copy ``environ`` without the entries of another clone of this project."""
    result = dict(environ)
    other = environ.get("ARES_WORKSPACE", "")
    if not other or other == str(root):
        return result
    for name in SEARCH_PATHS:
        if name in result:
            result[name] = _without(result[name], [other])
    for name in ("NUMBA_CACHE_DIR", "ROS_LOG_DIR", "VIRTUAL_ENV"):
        if _below(result.get(name, ""), [other]):
            del result[name]
    del result["ARES_WORKSPACE"]
    return result


def without_foreign_ros(environ: Mapping[str, str], ros: str) -> dict[str, str]:
    """Copy ``environ`` without the entries of a sourced ROS 2 that is not the one in use."""
    result = dict(environ)
    distro = environ.get("ROS_DISTRO", "")
    if not distro or (ros and distro == ROS_DISTRO):
        return result
    prefixes = split_path(environ.get("AMENT_PREFIX_PATH", ""))
    foreign = [prefix for prefix in prefixes if prefix not in ("/", "/usr", "/usr/local")]
    for name in SEARCH_PATHS:
        if name in result:
            result[name] = _without(result[name], foreign)
    for name in ("ROS_DISTRO", "COLCON_PREFIX_PATH"):
        result.pop(name, None)
    return result


@dataclasses.dataclass(frozen=True)
class Workspace:
    """Hold a prepared, or partly prepared, workspace.

    Attributes:
        root: top of the project.
        python: version of Python in .venv, such as "3.12".
        ros: prefix of the sourced ROS 2 on which it is built; "": the wheels.
        sourced: prefix of the ROS 2 that was sourced when .venv was made; "": none.
        ros_paths: search-path entries of that ROS 2, for shells without it.
    """

    root: Path
    python: str
    ros: str = ""
    sourced: str = ""
    ros_paths: Mapping[str, str] = dataclasses.field(default_factory=dict)

    @property
    def venv(self) -> Path:
        """Return the path of the virtual environment."""
        return self.root / ".venv"

    @property
    def site_packages(self) -> Path:
        """Return the folder of its packages."""
        return self.venv / "lib" / f"python{self.python}" / "site-packages"

    @property
    def interpreter(self) -> Path:
        """Return the path of its Python."""
        return self.venv / "bin" / "python"

    @property
    def log(self) -> Path:
        """Return the log of the last preparation."""
        return self.root / "build" / "prepare.log"

    @property
    def kernels(self) -> Path:
        """Return the folder of the compiled kernels for the present sources."""
        return self.root / "build" / "kernels" / kernel_digest(self.root)

    def environment(self, environ: Mapping[str, str], build: bool = False) -> dict[str, str]:
        """Make the environment in which the project runs from the user's.

        Args:
            environ: the user's environment, or one made by this function.
            build: leave out the workspace itself, for the tools that build it.
        """
        result = without_foreign_ros(without_other_clone(environ, self.root), self.ros)
        for name, value in self.ros_paths.items():
            present = split_path(result.get(name, ""))
            absent = [entry for entry in split_path(value) if entry not in present]
            result[name] = os.pathsep.join([*present, *absent])
        venv, install = str(self.venv), str(self.root / "install")
        front: dict[str, list[str]] = {name: [] for name in SEARCH_PATHS}
        front["PATH"] = [f"{venv}/bin"]
        if not build:
            front["AMENT_PREFIX_PATH"] += [install]
            front["LD_LIBRARY_PATH"] += [f"{install}/lib"]
            # the sources themselves, then colcon's metadata (entry points)
            mine = [path for path in packages(self.root) if (path / "setup.py").exists()]
            front["PYTHONPATH"] += [str(path) for path in mine]
            front["PYTHONPATH"] += [str(self.root / "build" / path.name) for path in mine]
            front["PYTHONPATH"] += [f"{install}/lib/python{self.python}/site-packages"]
        if self.ros:
            result["ROS_DISTRO"] = ROS_DISTRO
        else:
            front["AMENT_PREFIX_PATH"] += [venv]
            front["LD_LIBRARY_PATH"] += [f"{venv}/lib"]
            front["LD_LIBRARY_PATH"] += sorted(map(str, self.site_packages.glob("ros_*.libs")))
            # the wheels restart each Python to set LD_LIBRARY_PATH unless this is set
            result["_ROS_WHEELS_BOOTSTRAP_COMPLETE"] = "1"
        front["CMAKE_PREFIX_PATH"] = [
            *front["AMENT_PREFIX_PATH"],
            *split_path(result.get("AMENT_PREFIX_PATH", "")),
        ]
        for name, entries in front.items():
            old = [entry for entry in split_path(result.get(name, "")) if entry not in entries]
            if entries or old:
                result[name] = os.pathsep.join([*dict.fromkeys(entries), *old])
        result["VIRTUAL_ENV"] = venv
        result.pop("PYTHONHOME", None)
        previous = result.get("NUMBA_CACHE_DIR", "")
        if not previous or _below(previous, [f"{self.root}/build/kernels"]):
            result["NUMBA_CACHE_DIR"] = str(self.kernels)
        result["ARES_WORKSPACE"] = str(self.root)
        result.setdefault("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
        # the matrices are small, and OpenBLAS threads cost each Python 0.1 s
        result.setdefault("OPENBLAS_NUM_THREADS", "1")
        # else pydantic searches all installed packages for plugins at each start
        result.setdefault("PYDANTIC_DISABLE_PLUGINS", "__all__")
        result.setdefault("RMW_IMPLEMENTATION", "rmw_fastrtps_cpp")
        result.setdefault("ROS_LOG_DIR", str(self.root / "log" / "ros"))
        result.setdefault("PYTHONUNBUFFERED", "1")
        return result


# --- stamps --------------------------------------------------------------------------------


def read_stamp(path: Path) -> dict[str, str]:
    """Read a stamp; empty if it is missing or damaged."""
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return {}
    if not isinstance(content, dict):
        return {}
    return {str(key): str(value) for key, value in content.items()}


def write_stamp(path: Path, content: Mapping[str, str]) -> None:
    """Write a stamp atomically."""
    partial = path.with_name(path.name + ".partial")
    partial.write_text(json.dumps(dict(content), indent=1) + "\n", encoding="utf-8")
    os.replace(partial, path)


def venv_stamp(root: Path) -> Path:
    """Return the path of the stamp of .venv."""
    return root / ".venv" / ".ready"


def build_stamp(root: Path) -> Path:
    """Return the path of the stamp of build/ and install/."""
    return root / "build" / ".ready"


def prepared_environment(root: Path, environ: Mapping[str, str]) -> Workspace | None:
    """Return the workspace if its .venv is complete and matches ``environ``; else None."""
    stamp = read_stamp(venv_stamp(root))
    python, ros = stamp.get("python", ""), stamp.get("ros", "")
    if not python or not os.access(root / ".venv" / "bin" / "python", os.X_OK):
        return None
    if environ.get("PYTHON") and python != "{}.{}".format(*sys.version_info):
        return None
    sourced = sourced_ros(root, environ)
    if sourced and sourced != stamp.get("sourced"):
        return None
    if ros and not Path(ros, "share/rclpy/package.xml").exists():
        return None
    if stamp.get("digest") != environment_digest(root, python, ros):
        return None
    ros_paths = {name: stamp[f"ros {name}"] for name in SEARCH_PATHS if f"ros {name}" in stamp}
    return Workspace(root, python, ros, stamp.get("sourced", ""), ros_paths)


def addition_stamp(root: Path, name: str) -> Path:
    """Return the path of the stamp of an additional list of requirements."""
    return root / ".venv" / f".ready-{name}"


def missing_additions(workspace: Workspace, names: Sequence[str]) -> list[str]:
    """Return the lists of requirements that are not installed in their present version."""
    return [
        name
        for name in names
        if read_stamp(addition_stamp(workspace.root, name)) != addition_digest(workspace, name)
    ]


def addition_digest(workspace: Workspace, name: str) -> dict[str, str]:
    """Return the expected stamp of an installed list."""
    return {"digest": digest([lock_file(workspace.root, name).read_bytes()])}


def build_digests(workspace: Workspace) -> dict[str, str]:
    """Return the expected stamp of the built workspace."""
    root = workspace.root
    made_from = environment_digest(root, workspace.python, workspace.ros)
    return {"interfaces": interface_digest(root, made_from), "packages": package_digest(root)}


def is_built(workspace: Workspace) -> bool:
    """Tell whether build/ and install/ are complete and up to date."""
    root = workspace.root
    return (root / "install/setup.sh").exists() and (
        read_stamp(build_stamp(root)) == build_digests(workspace)
    )


# --- preparation ---------------------------------------------------------------------------


@contextlib.contextmanager
def preparation_lock(root: Path) -> Iterator[int]:
    """Hold the lock of the preparation; yield its descriptor.

    Children inherit the descriptor: if this process is killed, the lock is free only when
    its pip or colcon has ended too.
    """
    (root / "build").mkdir(exist_ok=True)
    descriptor = os.open(root / "build" / ".lock", os.O_RDWR | os.O_CREAT, 0o666)
    try:
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            say("another call is preparing the workspace; waiting for it")
            steps = Steps({OTHERS: time_left(descriptor)})
            with BAR.over(steps), steps.step(OTHERS):
                fcntl.flock(descriptor, fcntl.LOCK_EX)
        yield descriptor
    finally:
        os.close(descriptor)


def announce(lock: int, lengths: Mapping[str, float]) -> None:
    """Write the expected end of the preparation to the lock's file, for calls that wait."""
    os.ftruncate(lock, 0)
    os.pwrite(lock, f"{time.time() + sum(lengths.values()):.0f}".encode(), 0)


def time_left(lock: int) -> float:
    """Return the expected time left of the call with the lock, s; 1 s if unknown."""
    try:
        return max(float(os.pread(lock, 32, 0)) - time.time(), 1.0)
    except ValueError:
        return 1.0


NO_NETWORK = re.compile(
    r"name resolution|not known|NewConnectionError|ConnectTimeout|Connection refused"
    r"|Network is unreachable|Max retries|[Rr]ead timed out|ProxyError|from versions: none"
)


def cause_of_failure(output: str) -> str:
    """Return the line of a log that best explains a failure."""
    missing = re.search(r"(?:satisfies the requirement|found for) (\S+)", output)
    if NO_NETWORK.search(output):
        what = f" (pip could not get {missing[1]})" if missing else ""
        return f"no network or package index{what}: connect, or tell pip where its index is"
    if missing:
        return f"the package index has no {missing[1]} for this Python and machine"
    if "No space left on device" in output:
        return "the disk is full"
    lines = [line.strip() for line in output.splitlines() if line.strip()]
    blamed = [line for line in lines if re.search(r"\b[Ee]rror\b|ERROR", line)]
    return (blamed or lines or ["no output"])[-1][:200]


def run_logged(
    command: Sequence[str],
    workspace: Workspace,
    environ: Mapping[str, str],
    lock: int,
    task: str,
) -> None:
    """Run a command with its output in the log.

    Raises:
        WorkspaceError: it failed.
    """
    log = workspace.log
    log.parent.mkdir(exist_ok=True)
    with log.open("a", encoding="utf-8") as stream:
        stream.write(f"$ {shlex.join(command)}\n")
        stream.flush()
        begin = stream.tell()
        status = subprocess.run(
            list(command),
            cwd=workspace.root,
            env=dict(environ),
            stdin=subprocess.DEVNULL,
            stdout=stream,
            stderr=stream,
            pass_fds=(lock,),
            check=False,
        ).returncode
    if status != 0:
        with log.open("rb") as raw:
            raw.seek(begin)
            output = raw.read().decode(errors="replace")
        raise WorkspaceError(f"{task} failed: {cause_of_failure(output)} (log: {log})")


def relocate_cmake(share: Path, include: str, site_packages: str) -> int:
    """Point the wheels' exported CMake targets at this machine's Python; return the file count."""
    build_machine = re.compile(
        r"/opt/python/cp\d+-cp\d+/(include/python3\.\d+|lib/python3\.\d+/site-packages)"
    )
    changed = 0
    for path in sorted(share.rglob("*.cmake")):
        text = path.read_text(encoding="utf-8")
        moved = build_machine.sub(
            lambda match: include if match[1].startswith("include") else site_packages, text
        )
        if moved != text:
            # replace the file, since uv hard-links it to its cache
            path.unlink()
            path.write_text(moved, encoding="utf-8")
            changed += 1
    return changed


def repair_scripts(install: Path, interpreter: Path) -> None:
    """Let the shell start the node executables if a ``#!`` line cannot hold the Python's path.

    The system accepts no blanks there and cuts long lines.
    """
    start = f"#!{interpreter}"
    if " " not in start and len(start) < 127:
        return
    for path in sorted(install.glob("lib/ares_*/*")):
        first, _, rest = path.read_text(encoding="utf-8").partition("\n")
        if first.startswith("#!") and str(interpreter) in first:
            # a comment-like string to Python, a command to the shell
            shell = f"#!/bin/sh\n'''exec' {shlex.quote(str(interpreter))} \"$0\" \"$@\"\n' '''\n"
            path.write_text(shell + rest, encoding="utf-8")


def remove(path: Path) -> None:
    """Remove a file, a link or a folder, if it exists."""
    if path.is_symlink() or path.is_file():
        path.unlink()
    elif path.exists():
        shutil.rmtree(path)


def tool_environment(workspace: Workspace, environ: Mapping[str, str]) -> dict[str, str]:
    """Return the environment of the build tools."""
    result = workspace.environment(environ, build=True)
    if not workspace.ros:
        result.pop("PYTHONPATH", None)
    return result


def index_of_pip(workspace: Workspace, environ: Mapping[str, str]) -> dict[str, str]:
    """Return pip's package index for uv, which does not read pip's settings."""
    if "UV_DEFAULT_INDEX" in environ:
        return {}
    asked = subprocess.run(
        [str(workspace.interpreter), "-m", "pip", "config", "list"],
        env=dict(environ),
        capture_output=True,
        text=True,
        check=False,
    )
    found = re.findall(r"^\S*\.index-url='(.*)'$", asked.stdout, re.MULTILINE)
    index = environ.get("PIP_INDEX_URL") or (found[-1] if found else "")
    return {"UV_DEFAULT_INDEX": index} if index else {}


def install(
    names: Sequence[str], workspace: Workspace, environ: Mapping[str, str], lock: int
) -> None:
    """Install lists of requirements into .venv: by uv, or by pip if uv fails."""
    settings = tool_environment(workspace, environ)
    lists = [f"--requirements={lock_file(workspace.root, name)}" for name in names]
    options = ["--no-deps", "--require-hashes"]
    python = str(workspace.interpreter)
    uv = workspace.venv / "bin" / "uv"
    if uv.exists():
        command = [str(uv), "pip", "install", f"--python={python}"]
        if environ.get("PYTHONDONTWRITEBYTECODE"):
            # else each start would compile its imports
            command.append("--compile-bytecode")
        try:
            by_uv = settings | index_of_pip(workspace, settings)
            run_logged([*command, *options, *lists], workspace, by_uv, lock, "installing by uv")
        except WorkspaceError as problem:
            say(f"{problem}; trying pip, which takes longer")
        else:
            return
    # drop settings by which pip would install elsewhere
    for name in ("PIP_TARGET", "PIP_PREFIX", "PIP_ROOT", "PIP_REQUIRE_VIRTUALENV"):
        settings.pop(name, None)
    settings |= {"PIP_USER": "0", "PIP_NO_INPUT": "1", "PIP_DISABLE_PIP_VERSION_CHECK": "1"}
    lists = [f"--requirement={lock_file(workspace.root, name)}" for name in names]
    command = [python, "-m", "pip", "install", "--progress-bar=off", *options, *lists]
    run_logged(command, workspace, settings, lock, "installing into .venv")


def add(names: Sequence[str], workspace: Workspace, environ: Mapping[str, str], lock: int) -> None:
    """Install additional lists of requirements."""
    kinds = {
        "solve.txt": "what the optimizer needs",
        "live.txt": "what the live page needs",
        "pages.txt": "what pages and tables need",
        "dev.txt": "what the tests need",
    }
    say(f"installing {' and '.join(kinds[name] for name in names)} (once, half a minute)")
    for name in names:
        remove(addition_stamp(workspace.root, name))
    install(names, workspace, environ, lock)
    for name in names:
        write_stamp(addition_stamp(workspace.root, name), addition_digest(workspace, name))


def make_environment(root: Path, environ: Mapping[str, str], lock: int) -> Workspace:
    """Make .venv from scratch."""
    python, ros = base_python(), ""
    sourced = sourced_ros(root, environ)
    distro = environ.get("ROS_DISTRO", "")
    if sourced:
        ros_python = find_ros_python(environ)
        if ros_python:
            python, ros = ros_python, sourced
            say(f"using the sourced ROS 2 {ROS_DISTRO} in {ros}")
        else:
            say(f"no Python can import the rclpy in {sourced}; using ROS 2 wheels instead")
    elif distro and distro != ROS_DISTRO:
        say(f"the sourced ROS 2 is {distro}, this needs {ROS_DISTRO}; using ROS 2 wheels instead")
    version = subprocess.run(
        [python, "-I", "-S", "-c", "import sys; print('{}.{}'.format(*sys.version_info))"],
        capture_output=True,
        text=True,
        check=True,
    ).stdout.strip()
    workspace = Workspace(root, version, ros, sourced, ros_paths(environ) if ros else {})
    build_environ = tool_environment(workspace, environ)
    say(f"making a Python {version} environment in .venv")
    remove(workspace.venv)
    options = ["--system-site-packages"] if ros else []
    run_logged(
        [python, "-m", "venv", *options, str(workspace.venv)],
        workspace,
        build_environ,
        lock,
        "making .venv",
    )
    what = "what flying needs" if ros else "ROS 2 Jazzy and what flying needs"
    say(f"installing {what} into .venv (once, half a minute)")
    install([INSTALLER], workspace, environ, lock)
    names = REQUIREMENTS if ros else ROS_REQUIREMENTS + REQUIREMENTS
    install(names, workspace, environ, lock)
    if not ros:
        include = subprocess.run(
            [python, "-I", "-S", "-c", "import sysconfig; print(sysconfig.get_path('include'))"],
            capture_output=True,
            text=True,
            check=True,
        ).stdout.strip()
        relocate_cmake(workspace.venv / "share", include, str(workspace.site_packages))
    stamp = {
        "digest": environment_digest(root, version, ros),
        "python": version,
        "ros": ros,
        "sourced": sourced,
        **{f"ros {name}": value for name, value in workspace.ros_paths.items()},
    }
    write_stamp(venv_stamp(root), stamp)
    return workspace


def missing_interfaces(workspace: Workspace, environ: Mapping[str, str]) -> list[Path]:
    """Return the `interfaces` that the ROS 2 in use lacks."""
    install = str(workspace.root / "install")
    found = split_path(environ.get("AMENT_PREFIX_PATH", ""))
    shares = [Path(prefix, "share") for prefix in found if not _below(prefix, [install])]
    return [
        package
        for package in interfaces(workspace.root)
        if not any((share / package.name / "package.xml").exists() for share in shares)
    ]


def build(workspace: Workspace, environ: Mapping[str, str], lock: int) -> None:
    """Build src/ with colcon into build/ and install/."""
    root = workspace.root
    stamp = build_stamp(root)
    digests = build_digests(workspace)
    if (
        read_stamp(stamp).get("interfaces") == digests["interfaces"]
        and (root / "install/setup.sh").exists()
    ):
        say("building the Python packages anew")
    else:
        say("building the messages and packages (half a minute)")
        for path in [*(root / "build").glob("ares_*"), *(root / "build").glob("*_msgs")]:
            remove(path)
        remove(root / "install")
    remove(stamp)
    build_environ = tool_environment(workspace, environ) | {
        # no user settings, no desktop notification
        "COLCON_HOME": str(root / "build" / ".colcon"),
        "COLCON_DEFAULTS_FILE": os.devnull,
        "COLCON_EXTENSION_BLOCKLIST": "colcon_core.event_handler.desktop_notification",
        "PYTHONWARNINGS": "ignore",
        "MAKEFLAGS": f"-j{os.cpu_count() or 1}",
    }
    colcon = [str(workspace.interpreter), "-m", "colcon", "--log-base", "log", "build"]
    also = [str(path) for path in missing_interfaces(workspace, build_environ)]
    colcon += ["--base-paths", "src", *also, "--build-base", "build", "--install-base", "install"]
    colcon += ["--merge-install", "--symlink-install"]
    colcon += ["--event-handlers", "console_cohesion+"]
    colcon += ["--cmake-args", "-G", "Ninja", "-DBUILD_TESTING=OFF", "-DCMAKE_BUILD_TYPE=Release"]
    colcon += [f"-DPython3_EXECUTABLE={workspace.interpreter}"]
    run_logged(colcon, workspace, build_environ, lock, "colcon build")
    repair_scripts(root / "install", workspace.interpreter)
    run_logged(
        [
            str(workspace.interpreter),
            "-c",
            "import rclpy, ares_msgs.action, ares_msgs.msg, ares_msgs.srv, tf2_msgs.msg",
        ],
        workspace,
        workspace.environment(environ),
        lock,
        "importing the built messages",
    )
    write_stamp(stamp, digests)


def warm_kernels(workspace: Workspace, environ: Mapping[str, str], lock: int, what: str) -> None:
    """Compile kernels into a folder of their own and drop outdated ones.

    Args:
        workspace: with the requirements of flying installed.
        environ: the user's environment.
        lock: descriptor of the lock.
        what: ALL_KERNELS or a law.
    """
    folder = workspace.kernels
    folder.mkdir(parents=True, exist_ok=True)
    law = [] if what == ALL_KERNELS else [what]
    try:
        run_logged(
            [str(workspace.interpreter), "-m", "ares_studies.warm_up", *law],
            workspace,
            workspace.environment(environ),
            lock,
            "compiling the kernels",
        )
    except WorkspaceError as problem:
        # the caller compiles the kernels on demand, or fails with the true reason
        say(f"{problem}; going on without")
        return
    kernel_stamp(folder, what).touch()
    for other in folder.parent.iterdir():
        if other != folder:
            remove(other)


def kernel_stamp(folder: Path, what: str) -> Path:
    """Return the path of the stamp of all kernels, or of a law's."""
    return folder / (".ready" if what == ALL_KERNELS else f".ready-{what}")


def kernels_wanting(workspace: Workspace, environ: Mapping[str, str], what: str) -> bool:
    """Tell whether kernels are missing in the folder that this workspace uses."""
    folder = workspace.kernels
    if what == NO_KERNELS or workspace.environment(environ)["NUMBA_CACHE_DIR"] != str(folder):
        return False
    warm_up = workspace.root / "src/ares_studies/ares_studies/warm_up.py"
    ready = (kernel_stamp(folder, each).exists() for each in (ALL_KERNELS, what))
    return warm_up.exists() and not any(ready)


def kernels_for(arguments: Sequence[str]) -> str:
    """Return the kernels that a call needs: ALL_KERNELS, NO_KERNELS or the name of a law."""
    verb = arguments[0] if arguments else ""
    # a check flies the law of its bag, most likely FIRST_LAW
    checks = verb == "replay" and "--check" in arguments
    if verb in FEW_KERNELS and not checks:
        return NO_KERNELS
    if verb != "fly" and not checks:
        return ALL_KERNELS
    named = re.search(r"\0--guidance[=\0]([a-z][a-z0-9_]*)\0", "\0".join(["", *arguments, ""]))
    return named[1] if named else FIRST_LAW


def additions_for(arguments: Sequence[str]) -> tuple[str, ...]:
    """Return the lists of requirements that a call needs in addition to those of a plain flight."""
    verb = arguments[0] if arguments else ""
    if verb == "fly":
        solved = any(map(SOLVED_FOR.fullmatch, arguments))
        if any(map(SHOWN_BY.fullmatch, arguments)):
            return PAGES
        return ("solve.txt",) * solved + ("live.txt",) * ("--live" in arguments)
    if verb == "replay" and "--live" in arguments:
        return ("live.txt",)
    return ALSO.get(verb, ())


def prepare(
    root: Path, environ: Mapping[str, str], kernels: str, also: Sequence[str] = ()
) -> Workspace:
    """Make everything that is missing or out of date.

    Args:
        root: top of the project.
        environ: the user's environment.
        kernels: to compile: ALL_KERNELS, NO_KERNELS or the name of a law.
        also: additional lists of requirements.

    Raises:
        WorkspaceError: a prerequisite is missing, or a step failed.
    """
    workspace = prepared_environment(root, environ)
    if workspace and not steps_to_do(workspace, environ, kernels, also):
        return workspace
    with preparation_lock(root) as lock:
        # another call may have prepared it meanwhile
        workspace = prepared_environment(root, environ)
        lengths = steps_to_do(workspace, environ, kernels, also)
        if workspace and not lengths:
            return workspace
        if BUILDING in lengths:
            check_prerequisites(environ)
            remove(root / "build" / "prepare.log")
        announce(lock, lengths)
        steps = Steps(lengths)
        with BAR.over(steps):
            workspace = make(root, environ, kernels, also, lock, steps)
    left = sum(steps_to_do(workspace, environ, ALL_KERNELS, EVERYTHING).values())
    if left:
        say(
            "other verbs install or compile more when they are first used, and may need the"
            f" network; all of it now, about {left:.0f} s: ./ares prepare"
        )
    return workspace


def steps_to_do(
    workspace: Workspace | None, environ: Mapping[str, str], kernels: str, also: Sequence[str]
) -> dict[str, float]:
    """Return the steps due with their durations, s; arguments as for `prepare`."""
    due = {
        PACKAGES: not workspace,
        ADDITIONS: bool(missing_additions(workspace, also) if workspace else also),
        BUILDING: not workspace or not is_built(workspace),
        KERNELS: kernels_wanting(workspace, environ, kernels) if workspace else bool(kernels),
    }
    lengths = LENGTHS | ({KERNELS: ALL_KERNELS_LENGTH} if kernels == ALL_KERNELS else {})
    return {name: length for name, length in lengths.items() if due[name]}


def make(
    root: Path,
    environ: Mapping[str, str],
    kernels: str,
    also: Sequence[str],
    lock: int,
    steps: Steps,
) -> Workspace:
    """Do the steps that are due; arguments as for `prepare`."""
    with ThreadPoolExecutor(1) as beside:
        workspace = prepared_environment(root, environ)
        if not workspace:
            with steps.step(PACKAGES):
                workspace = make_environment(root, environ, lock)
        missing = missing_additions(workspace, also)
        if missing:
            with steps.step(ADDITIONS):
                add(missing, workspace, environ, lock)

        def compile_kernels() -> None:
            with steps.step(KERNELS):
                warm_kernels(workspace, environ, lock, kernels)

        compiling = None
        if kernels_wanting(workspace, environ, kernels):
            say(f"compiling the numeric kernels ({COMPILING[kernels == ALL_KERNELS]})")
            if kernels == FIRST_LAW or is_built(workspace):
                compiling = beside.submit(compile_kernels)
        if not is_built(workspace):
            with steps.step(BUILDING):
                build(workspace, environ, lock)
        if compiling is not None:
            compiling.result()
        elif kernels_wanting(workspace, environ, kernels):
            compile_kernels()
    return workspace


# --- a browser for the tests -----------------------------------------------------------------

BROWSERS = ("chromium", "chromium-browser", "google-chrome")
NO_BROWSER = (
    f"no browser found ({', '.join(BROWSERS)}), which the tests of the page of `ares reproduce`"
    " need: install one, for example `apt install chromium`"
)


def find_browser(environ: Mapping[str, str]) -> str | None:
    """Return the path of the first browser found."""
    path = environ.get("PATH", os.defpath)
    return next(filter(None, (shutil.which(name, path=path) for name in BROWSERS)), None)


def debian_packages(root: Path) -> list[str]:
    """Return the names in requirements/apt.list."""
    lines = (root / "requirements" / "apt.list").read_text(encoding="utf-8").splitlines()
    return [line for line in lines if line and not line.startswith("#")]


def install_browser(workspace: Workspace, environ: Mapping[str, str]) -> None:
    """Print what to install if no browser is found; as root, install it."""
    if find_browser(environ):
        return
    if os.geteuid() != 0 or not shutil.which("apt-get", path=environ.get("PATH", os.defpath)):
        say(NO_BROWSER)
        return
    say("installing a browser for the tests (once, a quarter of a minute)")
    settings = dict(environ) | {"DEBIAN_FRONTEND": "noninteractive"}
    install = ["install", "-y", "--no-install-recommends", *debian_packages(workspace.root)]
    steps = Steps({BROWSER: BROWSER_LENGTH})
    with preparation_lock(workspace.root) as lock, BAR.over(steps), steps.step(BROWSER):
        announce(lock, {BROWSER: BROWSER_LENGTH})
        try:
            for arguments in (["update"], install):
                command = ["apt-get", *arguments]
                run_logged(command, workspace, settings, lock, "installing a browser")
        except WorkspaceError as problem:
            say(f"{problem}; {NO_BROWSER}")


# --- verbs ---------------------------------------------------------------------------------


def print_environment(workspace: Workspace, environ: Mapping[str, str]) -> None:
    """Print shell code that enters the prepared environment."""
    target = workspace.environment(environ)
    for name in sorted(set(environ) - set(target)):
        print(f"unset {name}")
    for name in sorted(target):
        if environ.get(name) != target[name]:
            print(f"export {name}={shlex.quote(target[name])}")


def run_tests(workspace: Workspace, environ: Mapping[str, str], arguments: Sequence[str]) -> int:
    """Run the linters, the type checker and the tests; return the exit status.

    pytest runs even if a linter fails. The type checker runs beside it and reports at the end.
    """
    environment = workspace.environment(environ)
    # else each of some hundred processes, and each worker, would compile its imports
    environment.pop("PYTHONDONTWRITEBYTECODE", None)

    def begin(*options: str, stdout: int | None = None) -> subprocess.Popen[str]:
        command = [str(workspace.interpreter), "-m", *options]
        return subprocess.Popen(
            command, cwd=workspace.root, env=environment, text=True, stdout=stdout
        )

    failed: list[str] = []
    for options in (("ruff", "check", "."), ("ruff", "format", "--check", ".")):
        name = " ".join(options[:2])
        say(f"running {name}")
        if begin(*options).wait() != 0:
            failed.append(name)
    if failed:
        say(f"failed: {', '.join(failed)}; this run fails whatever the tests say")
    say("running the tests, and mypy beside them")
    with begin("mypy", stdout=subprocess.PIPE) as types:
        # many tests wait for a flight: three workers keep two cores busy
        status = begin("pytest", "--numprocesses=3", "--dist=worksteal", *arguments).wait()
        found, _ = types.communicate()
    say(f"mypy: {found.strip()}")
    return status or types.returncode or (1 if failed else 0)


def version(root: Path) -> str:
    """Read the version of the command line without importing it.

    Raises:
        WorkspaceError: there is none.
    """
    source = root / "src" / "ares_bringup" / "ares_bringup" / "__init__.py"
    found = re.search(r'^__version__ = "(.+)"$', source.read_text(encoding="utf-8"), re.MULTILINE)
    if not found:
        raise WorkspaceError(f"{source} names no __version__")
    return found[1]


def list_verbs() -> str:
    """List the verbs of the workspace for the help."""
    rows = (f"  {f'{verb} {follows}':<17}  {does}" for verb, (follows, does) in VERBS.items())
    return "\n".join(["", "Workspace:", *rows, ""])


def answer_at_once(arguments: Sequence[str]) -> int | None:
    """Answer a call that needs no preparation: help, version, unknown words.

    Args:
        arguments: the call.

    Returns:
        Its exit status; None if the call needs a preparation.

    Raises:
        WorkspaceError: the call is invalid; one line.
    """
    verb, rest = (arguments[0], arguments[1:]) if arguments else ("", ())
    if list(arguments) == ["--version"]:
        return show(f"ares {version(ROOT)}\n")
    if verb in VERBS:
        follows, does = VERBS[verb]
        if rest[:1] and rest[0] in usage.HELP_WORDS:
            return show(f"Usage: ares {verb} {follows}".rstrip() + f"\n\n  {does}\n")
        if rest and not follows:
            raise WorkspaceError(f"{verb} takes no arguments; here is {rest[0]!r}")
        return None
    said = usage.answer(arguments, tuple(VERBS))
    if said is None:
        return None
    if said.refusal:
        raise WorkspaceError(said.refusal)
    return show(said.out + (list_verbs() if verb in usage.HELP_WORDS else ""))


def show(text: str) -> int:
    """Print a text; return the exit status."""
    try:
        print(text, end="", flush=True)
    except OSError as problem:
        if not isinstance(problem, BrokenPipeError):
            # EPIPE means that the reader has gone
            say(f"standard output cannot be written: {problem.strerror}")
        if sys.stdout is not None:
            os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 1
    return 0


def keep_standard_streams() -> None:
    """Open closed standard streams on /dev/null, so that no other file gets their descriptors."""
    for number in (0, 1, 2):
        try:
            os.fstat(number)
        except OSError:
            os.set_inheritable(os.open(os.devnull, os.O_RDWR), True)


def main(arguments: list[str]) -> int:
    """Run one call of ``./ares``; return the exit status unless another program takes over."""
    keep_standard_streams()
    if sys.version_info[:2] not in PYTHONS:
        raise WorkspaceError(
            f"Python {sys.version_info[0]}.{sys.version_info[1]} at {sys.executable} does not fit:"
            " install Python 3.11, 3.12 or 3.13, or name one in PYTHON"
        )
    status = answer_at_once(arguments)
    if status is not None:
        return status
    verb, rest = (arguments[0], list(arguments[1:])) if arguments else ("", [])
    environ = without_other_clone(os.environ, ROOT)
    workspace = prepare(ROOT, environ, kernels_for(arguments), additions_for(arguments))
    if verb == "prepare":
        say("the workspace is prepared")
        return 0
    if verb == "env":
        print_environment(workspace, os.environ)
        return 0
    if verb == "test":
        install_browser(workspace, environ)
        return run_tests(workspace, environ, rest)
    environment = workspace.environment(environ)
    command = [str(workspace.interpreter), "-m", "ares_bringup", *arguments]
    if verb == "exec":
        if not rest:
            raise WorkspaceError("exec needs a command, for example: ./ares exec ruff check")
        found = shutil.which(rest[0], path=environment["PATH"])
        if not found:
            raise WorkspaceError(f"exec: no command {rest[0]!r} in the prepared environment")
        command = [found, *rest[1:]]
    if sys.stdout is not None:
        sys.stdout.flush()
    os.execve(command[0], command, environment)


if __name__ == "__main__":
    try:
        sys.exit(main(sys.argv[1:]))
    except (WorkspaceError, OSError) as problem:
        say(str(problem))
        sys.exit(2)
    except KeyboardInterrupt:
        say("interrupted; the next call goes on from here")
        sys.exit(130)
