# SPDX-License-Identifier: Apache-2.0
"""docs/your_law.md, followed literally, except for the place of installation."""

import fcntl
import importlib
import json
import os
import re
import subprocess
import sys
from dataclasses import fields
from importlib.metadata import EntryPoint
from pathlib import Path

import numpy as np
import pytest

from ares_bags.reader import open_bag
from ares_guidance import own_law
from ares_guidance.law import LawKind
from ares_guidance.registry import GROUP
from ares_models.arrays import NAVIGATION
from ares_trials.testing.samples import one_in

PAGE = Path(__file__).parent.parent / "docs" / "your_law.md"


@pytest.fixture(scope="module")
def installed(pytestconfig):
    """Return the environment of a user who has installed the page's package.

    The place is that of the run before: it takes half a minute to compile the law, which is kept
    like all other kernels while no source changes.
    """
    folder = pytestconfig.cache.mkdir("linear_tangent")
    law, setup = re.findall(r"```python\n(.*?)```", PAGE.read_text(), re.DOTALL)
    with (folder.parent / "linear_tangent.lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        for name, text in {"linear_tangent.py": law, "setup.py": setup}.items():
            # by the time of its file numba knows whether the law is the same
            if not (folder / name).exists() or (folder / name).read_text() != text:
                (folder / name).write_text(text)
        setup = [sys.executable, "setup.py", "--quiet", "egg_info"]
        subprocess.run(setup, cwd=folder, check=True, capture_output=True)
    path = os.pathsep.join([str(folder), os.environ["PYTHONPATH"]])
    return {**os.environ, "PYTHONPATH": path}


def ares(environment, *words):
    command = [sys.executable, "-m", "ares_bringup", *map(str, words)]
    return subprocess.run(command, env=environment, capture_output=True, text=True, check=False)


@pytest.mark.trial
@pytest.mark.long
@pytest.mark.parametrize("layout", one_in(2, [["--in-process"], []]))
def test_the_law_of_the_page_flies_ares_v(installed, tmp_path, layout):
    flown = ares(
        installed,
        "fly",
        "--mission",
        "ares_v",
        "--guidance",
        "linear_tangent",
        "--bag",
        tmp_path / "bag",
        "--json",
        *layout,
    )
    assert flown.returncode == 0, flown.stderr
    summary = json.loads(flown.stdout)
    assert summary["outcome"] == "target"
    assert summary["shortcomings"] == []
    assert summary["m_f_kg"] == pytest.approx(174_062.0, abs=1.0)
    assert set(open_bag(tmp_path / "bag").columns("/ares/guidance_status")["law"]) == {128}


@pytest.mark.trial
def test_it_flies_campaigns_too(installed):
    flown = ares(installed, "montecarlo", "--guidance", "linear_tangent", "--only", "3", "--json")
    assert flown.returncode == 0, flown.stderr
    (flight,) = json.loads(flown.stdout)["flights"]
    assert flight["outcome"] == "success"


def test_it_is_listed_where_it_is_installed_only(installed):
    assert "linear_tangent" in ares(installed, "fly", "--help").stdout
    refused = ares(os.environ, "fly", "--guidance", "linear_tangent")
    assert refused.returncode == 2
    assert refused.stderr == (
        "ares: guidance is 'linear_tangent'; expected one of igm, optimal, peg, peg_thesis\n"
    )


def test_a_law_that_is_broken_is_one_line(installed, tmp_path):
    (tmp_path / "linear_tangent.py").write_text("import nothing_of_that_name\n")
    path = os.pathsep.join([str(tmp_path), installed["PYTHONPATH"]])
    refused = ares({**installed, "PYTHONPATH": path}, "fly", "--guidance", "linear_tangent")
    assert refused.returncode == 2
    assert refused.stderr.count("\n") == 1
    assert (
        "which linear_tangent:LAW should be: No module named 'nothing_of_that_name'"
        in refused.stderr
    )


@pytest.mark.parametrize(
    ("right", "wrong", "line", "reason"),
    [
        ("r_go = sub(", "r_go = subb(", 30, "NameError: name 'subb' is not defined"),
        # to compile as far takes seconds
        pytest.param(
            *("nav.position", "nav.positon", 18, "KeyError: 'positon'"), marks=pytest.mark.trial
        ),
        pytest.param(
            *("norm(sub(v_go, before))", "norm(sub(v_go))", 50, "Cannot bind"),
            marks=pytest.mark.trial,
        ),
        ("LAW = law_of_pass(", "LAW = lawofpass(", 53, "NameError: name 'lawofpass'"),
        ("def iterate(", "def iterate((", 14, "SyntaxError"),
    ],
)
def test_a_law_that_fails_is_one_line_that_names_the_place(
    installed, tmp_path, right, wrong, line, reason
):
    law, _ = re.findall(r"```python\n(.*?)```", PAGE.read_text(), re.DOTALL)
    assert right in law
    path = tmp_path / "linear_tangent.py"
    path.write_text(law.replace(right, wrong))
    places = os.pathsep.join([str(tmp_path), installed["PYTHONPATH"]])
    words = ("fly", "--mission", "ares_v", "--guidance", "linear_tangent", "--no-record")
    refused = ares({**installed, "PYTHONPATH": places}, *words)
    assert refused.returncode == 2
    assert refused.stderr.count("\n") == 1
    said = f"ares: law linear_tangent fails in {path}, line {line}: {reason}"
    assert refused.stderr.startswith(said)


@pytest.mark.parametrize(
    ("wrong", "reason"),
    [("nav.time + nav.tme", "KeyError: 'tme'"), ("nav.time + half()", "Cannot bind")],
)
def test_a_kernel_that_fails_is_one_line_that_names_the_place(tmp_path, monkeypatch, wrong, reason):
    """Compile a kernel that is called by another, as the pass of a law is."""
    path = tmp_path / "some_law.py"
    path.write_text(
        "from ares_models.jit import kernel\n\n\n"
        "@kernel\ndef half(x):\n    return 0.5 * x\n\n\n"
        f"@kernel\ndef iterate(nav):\n    return {wrong}\n\n\n"
        "@kernel\ndef answer(nav):\n    return iterate(nav)\n"
    )
    monkeypatch.syspath_prepend(tmp_path)
    law = EntryPoint("some_law", "some_law:LAW", GROUP)
    monkeypatch.setattr(own_law, "registered", lambda _: {"some_law": law})
    answer = importlib.import_module("some_law").answer
    said = re.escape(f"law some_law fails in {path}, line 11: {reason}")
    with pytest.raises(ValueError, match=f"^{said}"), own_law.one_line_each("some_law"):
        answer(np.zeros(1, NAVIGATION)[0])
    del sys.modules["some_law"]


def test_what_pages_name_of_a_law_there_is():
    """Check that fields of `LawKind` named in docs exist."""
    pages = (Path(__file__).parent.parent / "docs").glob("*.md")
    named = {
        name for page in pages for name in re.findall(r"`LawKind\.(\w+)", page.read_text("utf-8"))
    }
    assert "holds_attitude" in named
    assert named - {field.name for field in fields(LawKind)} == set()
