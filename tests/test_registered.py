# SPDX-License-Identifier: Apache-2.0
"""Laws, methods and verbs of other packages: found by name, missed or broken in one line."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from ares_guidance import laws
from ares_guidance.laws import find_law
from ares_guidance.registry import law_names
from ares_models.registry import load_registered, registered
from ares_optimizer.registry import METHODS, method_names
from ares_trials.testing.samples import one_in

#: Packages that no other imports.
LEAVES = ("ares_thesis", "ares_trials")


def run(path, *words):
    command = [sys.executable, "-m", "ares_bringup", *words]
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(map(str, path))}
    return subprocess.run(
        command, env=environment, capture_output=True, text=True, timeout=240, check=False
    )


def paths():
    return os.environ["PYTHONPATH"].split(os.pathsep)


@pytest.fixture(scope="module")
def without_leaves():
    """Return the search path of Python in a workspace without the thesis and the trials."""
    found = [path for path in paths() if Path(path).name not in LEAVES]
    assert len(found) == len(paths()) - 2 * len(LEAVES)
    return found


def register(folder, group, line):
    """Register something as an installed package would; its name is the folder's."""
    about = folder / f"{folder.name}-1.dist-info"
    about.mkdir()
    (about / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {folder.name}\nVersion: 1\n")
    (about / "entry_points.txt").write_text(f"[{group}]\n{line}\n")


def test_what_the_thesis_and_the_trials_bring_is_there():
    assert "peg_thesis" in law_names()
    assert method_names() == (*METHODS, "analytic")
    assert set(registered("ares_bringup.verbs")) == {"faults", "reproduce"}


def test_each_module_of_laws_is_a_law():
    modules = {path.stem for path in Path(laws.__file__).parent.glob("[a-z]*.py")}
    assert modules
    assert modules <= set(law_names())
    assert all(find_law(name).name == name for name in modules)


def test_the_core_flies_without_them(without_leaves):
    words = ("--mission", "ares_v", "--in-process", "--no-record", "--nav-period", "1", "--json")
    done = run(without_leaves, "fly", *words)
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout)["outcome"] == "target"


@pytest.mark.trial
def test_the_core_prints_its_optimum_without_a_published_one(without_leaves):
    done = run(without_leaves, "optimize", "--method", "direct11")
    assert done.returncode == 0, done.stderr
    assert "174,183" in done.stdout
    assert "OTIS" not in done.stdout


@pytest.mark.parametrize(
    ("words", "complaint"),
    one_in(
        2,
        [
            (["optimize", "--method", "analytic"], "method is 'analytic'; expected one of auto, "),
            (["optimize", "--profile", "thesis"], "No such option: --profile"),
            (["fly", "--guidance", "peg_thesis"], "expected one of igm, optimal, peg"),
            (["reproduce"], "No such command 'reproduce'"),
            (["faults", "-n", "1"], "No such command 'faults'"),
        ],
    ),
)
def test_what_is_not_installed_is_one_line(without_leaves, words, complaint):
    done = run(without_leaves, *words)
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr.count("\n") == 1
    assert complaint in done.stderr


@pytest.mark.parametrize(
    ("group", "line", "words", "complaint"),
    one_in(
        2,
        [
            (
                "ares_bringup.verbs",
                "mine = no_such_module:verb",
                ["mine"],
                "no_such_module:verb cannot be imported: No module named 'no_such_module'",
            ),
            (
                "ares_optimizer.methods",
                "mine = no_such_module:METHOD",
                ["optimize", "--method", "mine"],
                "method is 'mine', which no_such_module:METHOD should be: No module named",
            ),
            (
                "ares_optimizer.methods",
                "mine = math:pi",
                ["optimize", "--method", "mine"],
                "method is 'mine'; expected math:pi to be the MethodKind of that name",
            ),
        ],
    ),
)
def test_what_is_broken_is_one_line(tmp_path, group, line, words, complaint):
    register(tmp_path, group, line)
    done = run([tmp_path, *paths()], *words)
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr.count("\n") == 1
    assert complaint in done.stderr


def test_a_verb_of_another_package_is_called(tmp_path):
    (tmp_path / "verb_of_mine.py").write_text(
        'def greet(name: str = "you") -> None:\n    """Greet."""\n    print(f"hello, {name}")\n'
    )
    register(tmp_path, "ares_bringup.verbs", "greet = verb_of_mine:greet")
    done = run([tmp_path, *paths()], "greet", "--name", "pilot")
    assert (done.returncode, done.stdout, done.stderr) == (0, "hello, pilot\n", "")


def test_another_object_under_a_name_is_refused():
    with pytest.raises(ValueError, match=r"law is 'peg'; expected .* to be the str of that name"):
        load_registered("ares_guidance.laws", "law", "peg", str)
