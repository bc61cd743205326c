# SPDX-License-Identifier: Apache-2.0
"""Inputs that the schemas accept fly, are solved, or are refused; all others are refused."""

import json
import os
import re
import signal
from collections import Counter
from pathlib import Path
from typing import Annotated, Literal, get_args, get_origin

import pytest

from ares_models.mission import Mission
from ares_models.mission_keys import Part
from ares_models.ranges import Range
from ares_trials.sweep.attempts import ACTIONS, DISPERSIONS, MISSION
from ares_trials.sweep.inputs import all_keys, inputs, to_yaml, used_keys
from ares_trials.sweep.plan import all_inputs, bases, each_once, tasks, warm_up
from ares_trials.sweep.pool import AttemptWorker, Task, attempt_all
from ares_vehicle_sim.dispersions import Dispersions, SpreadRange

DOCS = Path(__file__).parent.parent / "docs"
#: Distinct files that there are to try, at least.
ENOUGH = 5000

SCHEMAS = {MISSION: Mission, DISPERSIONS: Dispersions}
PAGES = {MISSION: DOCS / "missions.md", DISPERSIONS: DOCS / "montecarlo.md"}


def thinned(every, found):
    """Return a share of the tasks: of those of each action, and of those that are read only."""
    alike = {}
    for task in found:
        alike.setdefault(task.actions, []).append(task)
    return [task for some in alike.values() for task in some[::every]]


# `make sweep` does everything with each
@pytest.mark.long
@pytest.mark.timeout(1500)
@pytest.mark.trial
@pytest.mark.parametrize("every", [100, 1])
def test_every_value_is_flown_or_solved_or_refused_in_one_line(every, monkeypatch):
    if every > 1:
        # to warm up another worker takes longer than its share of so few
        monkeypatch.setattr("os.sched_getaffinity", lambda _process: {0})
    chosen = {kind: each_once(all_inputs(kind)) for kind in ACTIONS}
    found = [task for kind, some in chosen.items() for task in tasks(kind, some, everything=False)]
    # a good file first, with which everything can be done
    first = warm_up()
    texts = {task.text for task in first}
    todo = first + [task for task in thinned(every, found) if task.text not in texts]
    assert len({task.text for task in todo}) == len(todo) >= ENOUGH // every
    results = list(attempt_all(todo, warm_up()))
    assert [str(result) for result in results if result.broken] == []

    read = {result.task.text: result for result in results if result.action.startswith("read")}
    assert len(read) == len(todo)
    fits = {one.fit: [] for some in chosen.values() for one in some}
    for some in chosen.values():
        for one in some:
            if (text := to_yaml(one.data)) in read:
                fits[one.fit].append(read[text])
    # what no file may hold is held by none
    assert [str(result) for result in fits[False] if not result.refused] == []
    # and what the schema names is refused for what stands beside it only
    own = re.compile(r"expected (a number|an integer) (from|of) [-0-9.e]+ to|expected one of '")
    assert [str(result) for result in fits[True] if own.search(result.outcome)] == []
    done = Counter(result.action for result in results if not result.refused)
    assert set(done) >= {action for actions in ACTIONS.values() for action in actions}


# beside the test above, whose process has made them
@pytest.mark.long
@pytest.mark.parametrize("kind", ACTIONS)
def test_the_inputs_are_made_from_the_schema(kind):
    found = all_inputs(kind)
    some = [to_yaml(one.data) for one in found[::10]]
    assert len(set(some)) == len(some)
    paths = {tuple(key for key in one.path if isinstance(key, str)) for one in found}
    tried = {key for path in paths for key in path}
    assert {key for _, key in all_keys(SCHEMAS[kind])} <= tried
    # what is in no file is made up: but then it is tried alone, in one way
    used = set().union(*(used_keys(SCHEMAS[kind], data) for data in bases(kind).values()))
    assert all_keys(SCHEMAS[kind]) == used


def test_a_new_key_is_tried_without_a_word():
    class Inner(Part):
        depth_m: Annotated[float, Range(1.0, 5.0)]

    class Outer(Part):
        colour: Literal["red", "blue"] = "red"
        inner: Inner | None = None

    tried = {str(one): one.fit for one in inputs(Outer, {"old": {}})}
    for value in ('"red"', '"blue"'):
        assert tried[f"old: colour = {value}"] is True
    assert tried['old: colour = "no such choice"'] is False
    for value in ("1.0", "5.0", "0.9999999999999999", "5.000000000000001", "1e+308", "-1e+308"):
        assert f'old: inner = {{"depth_m": {value}}}' in tried
    assert 'old: inner = {"depth_m": 1e-320}' in tried


@pytest.mark.trial
def test_a_crash_and_a_hang_are_findings_and_the_rest_goes_on():
    good = next(task for task in warm_up() if task.name == "ares_v")
    task = Task("good", MISSION, good.text, ("fly peg",))
    worker = AttemptWorker([])
    patience = worker.wall_limit_s
    try:
        assert [result.outcome for result in worker.attempt(task)] == ["done", "done"]
        for number, words in (
            (signal.SIGSEGV, "crash, SIGSEGV"),
            (signal.SIGXCPU, "hang, more than 60 s of CPU time"),
            (signal.SIGSTOP, "no answer within 1 s"),
        ):
            os.kill(worker.pid, number)
            worker.wall_limit_s = 1.0 if number == signal.SIGSTOP else patience
            (lost,) = worker.attempt(task)
            worker.wall_limit_s = patience
            assert lost.broken
            assert words in str(lost)
            assert [result.outcome for result in worker.attempt(task)] == ["done", "done"]
    finally:
        worker.close()
    assert worker.pid is None


def _fly(ares, path, law):
    # navigation seldom, since the numbers do not matter
    options = ("--in-process", "--no-record", "--json", "--nav-period", "1")
    return ares("fly", "--mission", str(path), "--guidance", law, *options)


@pytest.mark.parametrize(
    ("name", "law", "path", "value"),
    [
        ("elements", "peg", ("target", "eccentricity"), 0.0),
        ("ares_v", "optimal", ("environment", "atmosphere", "model"), "pra63_data"),
        ("saturn_v_as506", "igm", ("environment", "atmosphere", "density_factor"), 1e-30),
        pytest.param(
            *("ares_v", "peg", ("initial_state", "time_s"), -1e6), marks=pytest.mark.trial
        ),
        ("ares_v", "optimal", ("initial_state", "time_s"), 1e7),
    ],
)
def test_the_command_flies_what_is_accepted(tmp_path, ares, name, law, path, value):
    data = bases(MISSION)[name]
    at = data
    for key in path[:-1]:
        at = at[key]
    at[path[-1]] = value
    file = tmp_path / "bound.yaml"
    file.write_text(to_yaml(data))
    done = _fly(ares, file, law)
    assert done.returncode in (0, 1), done.stderr
    assert "Traceback" not in done.stderr
    assert json.loads(done.stdout)["guidance"] == law


@pytest.mark.parametrize("value", [1e308, -1e308, 1e-320])
def test_the_command_refuses_in_one_line_what_is_absurd(tmp_path, ares, value):
    data = bases(MISSION)["ares_v"]
    data["environment"]["g0_m_s2"] = value
    file = tmp_path / "absurd.yaml"
    file.write_text(to_yaml(data))
    done = _fly(ares, file, "peg")
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr.count("\n") == 1
    assert "environment.g0_m_s2 is" in done.stderr
    assert "expected a number from 0.1 to 100 in m/s2" in done.stderr


# ---- the pages say what the schemas say


def _rows(page):
    """Return the rows of a page's tables by the last part of their keys."""
    rows = {}
    for line in page.read_text().splitlines():
        if line.startswith("| ") and "`" in line.split("|")[1]:
            for key in re.findall(r"`([a-z0-9_.]+)`", line.split("|")[1]):
                rows.setdefault(key.rpartition(".")[2], []).append(line)
    return rows


def _limits(annotation):
    """Yield ranges, spreads and choices anywhere in a type, except in models."""
    if get_origin(annotation) is Literal:
        yield from (choice for choice in get_args(annotation))
    for note in getattr(annotation, "__metadata__", ()):
        if isinstance(note, (Range, SpreadRange)):
            yield note
    for inner in get_args(annotation):
        yield from _limits(inner)


def _models(annotation):
    if isinstance(annotation, type) and issubclass(annotation, Part):
        return {annotation}
    return set().union(*(_models(inner) for inner in get_args(annotation)))


def _fields(model):
    for key, info in model.model_fields.items():
        annotation = info.rebuild_annotation()
        yield model, key, annotation
        for part in _models(annotation):
            yield from _fields(part)


@pytest.mark.parametrize("kind", ACTIONS)
def test_the_page_states_every_range_and_every_choice(kind):
    text, rows = PAGES[kind].read_text(), _rows(PAGES[kind])
    missing = []
    for model, key, annotation in _fields(SCHEMAS[kind]):
        for limit in _limits(annotation):
            if isinstance(limit, str):
                stated = f"`{limit}`" in text
            elif isinstance(limit, SpreadRange):
                stated = any(
                    f"| {limit.limit:g} |" in row.replace("1e6", "1e+06") for row in rows[key]
                )
            else:
                lines = rows.get(key, text.splitlines())
                stated = any(f" {limit}" in row for row in lines if f"`{key}`" in row or key in row)
            if not stated:
                missing.append(f"{model.__name__}.{key}: {limit}")
    assert missing == []


@pytest.mark.parametrize("kind", ACTIONS)
def test_the_page_says_of_each_key_what_the_schema_says(kind):
    rows = _rows(PAGES[kind])
    missing = [
        f"{model.__name__}.{key}: {model.model_fields[key].description}"
        for model, key, _ in _fields(SCHEMAS[kind])
        if not any(
            model.model_fields[key].description in row.replace("`", "") for row in rows.get(key, ())
        )
    ]
    assert missing == []
