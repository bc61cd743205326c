# SPDX-License-Identifier: Apache-2.0
"""The JSON Schemas of files: they accept what a loader accepts, and refuse invalid values."""

import json
import math
from functools import cache

import pytest
from jsonschema import Draft202012Validator
from pydantic import ValidationError

from ares_models.input_file import Nothing
from ares_models.json_schema import json_schema
from ares_models.mission import Mission
from ares_trials.sweep.attempts import ACTIONS, DISPERSIONS, MISSION
from ares_trials.sweep.inputs import inputs
from ares_trials.sweep.plan import all_inputs, bases, each_once
from ares_vehicle_sim.dispersions import Dispersions

MODELS = {MISSION: Mission, DISPERSIONS: Dispersions}
#: One in so many of the files is tried.
SHARES = [7, pytest.param(1, marks=pytest.mark.trial)]


@cache
def validator(kind):
    schema = json.loads(json_schema(MODELS[kind], kind))
    Draft202012Validator.check_schema(schema)
    return Draft202012Validator(schema)


@cache
def tried(kind, every):
    """Return each value of each key once, as far as JSON allows: finite numbers only.

    A share of them is made from half of the files.
    """
    if every > 1:
        some = dict([*bases(kind).items()][:: 2 if kind == MISSION else 1])
        found = list(inputs(MODELS[kind], some))
    else:
        found = all_inputs(kind)
    return [one for one in each_once(found)[::every] if finite(one.data)]


def finite(value):
    if isinstance(value, dict):
        return all(map(finite, value.values()))
    if isinstance(value, (list, tuple)):
        return all(map(finite, value))
    return not isinstance(value, float) or math.isfinite(value)


def as_read(value):
    """Return a value of a file as its reader does."""
    if isinstance(value, dict):
        return {key: as_read(one) for key, one in value.items()}
    if isinstance(value, (list, tuple)):
        return [as_read(one) for one in value]
    return Nothing() if value is None else value


def loads(kind, data):
    try:
        MODELS[kind].model_validate(as_read(data))
    except ValidationError:
        return False
    return True


@pytest.mark.parametrize("kind", ACTIONS)
def test_every_good_file_validates(kind):
    for name, data in bases(kind).items():
        assert [error.message for error in validator(kind).iter_errors(data)] == [], name


@pytest.mark.parametrize("every", SHARES)
@pytest.mark.parametrize("kind", ACTIONS)
def test_what_no_file_may_hold_is_refused(kind, every):
    wrong = [one for one in tried(kind, every) if one.fit is False]
    assert len(wrong) > 300 // every
    assert [str(one) for one in wrong if validator(kind).is_valid(one.data)] == []


@pytest.mark.parametrize("every", SHARES)
@pytest.mark.parametrize("kind", ACTIONS)
def test_nothing_is_refused_that_a_loader_takes(kind, every):
    refused = [one for one in tried(kind, every) if not validator(kind).is_valid(one.data)]
    assert [str(one) for one in refused if loads(kind, one.data)] == []


@pytest.mark.parametrize(
    ("kind", "base", "change", "said"),
    [
        (MISSION, "delta_iii", {"stages": []}, "should be non-empty"),
        (MISSION, "delta_iii", {"nmae": "x"}, "'nmae' was unexpected"),
        (MISSION, "delta_iii", {"payload_kg": None}, "None is not of type 'number'"),
        (MISSION, "delta_iii", {"target": {"at": "perigee", "where": 1}}, "not valid under any"),
        (DISPERSIONS, "standard", {"thrust": 0.3}, "not valid under any"),
        (DISPERSIONS, "standard", {"draws": "dice"}, "'dice' is not one of"),
    ],
)
def test_what_an_editor_says(kind, base, change, said):
    errors = [error.message for error in validator(kind).iter_errors(bases(kind)[base] | change)]
    assert len(errors) == 1
    assert said in errors[0]


@pytest.mark.parametrize("kind", ACTIONS)
def test_every_key_is_explained(kind):
    schema = validator(kind).schema
    parts = [schema, *schema["$defs"].values()]
    missing = [
        key
        for part in parts
        for key, value in part["properties"].items()
        if not value.get("description")
    ]
    assert missing == []
