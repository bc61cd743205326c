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

import os
import re
import shlex
import shutil
import signal
import subprocess
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path

#: What ends the command; blocked while Python starts, since it would print a traceback.
SIGNALS = (signal.SIGINT, signal.SIGTERM)
if __name__ == "__main__":
    signal.pthread_sigmask(signal.SIG_BLOCK, SIGNALS)

ROOT = Path(__file__).resolve().parent.parent
sys.path[:0] = [str(ROOT / name) for name in ("tools", "src/ares_models", "src/ares_bringup")]
# standard library only
from ares_bringup import usage  # noqa: E402
from preparation.browser import install_browser  # noqa: E402
from preparation.layout import Workspace  # noqa: E402
from preparation.needs import additions_for, kernels_for  # noqa: E402
from preparation.paths import PYTHONS, without_other_clone  # noqa: E402
from preparation.progress import say  # noqa: E402
from preparation.running import WorkspaceError  # noqa: E402
from preparation.steps import prepare  # noqa: E402

#: Verbs of the workspace: arguments and help.
VERBS = {
    "prepare": ("", "make the workspace ready, nothing else"),
    "exec": ("COMMAND ...", "run a command in the prepared environment"),
    "env": ("", 'print that environment for a shell: eval "$(./ares env)"'),
    "test": ("[ARG ...]", "linters, type checker and all tests; arguments go to pytest"),
}

#: Workers of the tests in addition to one for each core, since many tests wait for a flight; most
#: of them, since each takes a GiB.
SPARE_WORKERS = 2
MOST_WORKERS = 8


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
        workers = f"--numprocesses={min((os.cpu_count() or 1) + SPARE_WORKERS, MOST_WORKERS)}"
        status = begin("pytest", workers, "--dist=worksteal", *arguments).wait()
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
        if verb == "exec" and not rest:
            raise WorkspaceError("exec needs a command, for example: ./ares exec ruff check")
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
        found = shutil.which(rest[0], path=environment["PATH"])
        if not found:
            raise WorkspaceError(f"exec: no command {rest[0]!r} in the prepared environment")
        command = [found, *rest[1:]]
    else:
        signal.pthread_sigmask(signal.SIG_BLOCK, SIGNALS)
    if sys.stdout is not None:
        sys.stdout.flush()
    os.execve(command[0], command, environment)


if __name__ == "__main__":
    try:
        signal.pthread_sigmask(signal.SIG_UNBLOCK, SIGNALS)
        sys.exit(main(sys.argv[1:]))
    except (WorkspaceError, OSError) as problem:
        say(str(problem))
        sys.exit(2)
    except KeyboardInterrupt:
        say("interrupted; the next call goes on from here")
        sys.exit(130)
