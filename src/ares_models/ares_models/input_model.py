# SPDX-License-Identifier: Apache-2.0
"""Check the content of an input file against its model, with errors that name key and line."""

from collections.abc import Mapping
from typing import Any, TypeVar, get_args

from pydantic import BaseModel, ValidationError

from ares_models.input_file import InputKind, KeyPath, by_cause, explain, parse_input

_Model = TypeVar("_Model", bound=BaseModel)


def parse_model(
    text: str,
    source: str,
    kind: InputKind,
    model: type[_Model],
    forms: Mapping[str, type[BaseModel]] | None = None,
    blocks: Mapping[str, str] | None = None,
) -> _Model:
    """Parse and check the text of a file.

    Args:
        text: of the file.
        source: name of the file in errors.
        kind: of the file.
        model: of its content.
        forms: model of each form of a mapping that has several, by the tag of the form.
        blocks: as in :func:`ares_models.input_file.explain`.

    Raises:
        InputError: of the kind; one line with key path, found value and expected one of each error.
    """
    data, lines = parse_input(text, source, kind)
    try:
        return model.model_validate(data)
    except ValidationError as error:
        problems = [
            explain(item, lines, lambda location: _known_keys(location, model, forms or {}), blocks)
            for item in by_cause(error.errors())
        ]
        raise kind.error(source, problems) from None


def _known_keys(
    location: KeyPath, model: type[BaseModel], forms: Mapping[str, type[BaseModel]]
) -> list[str]:
    """List the known keys of the mapping around a location."""
    for part in (part for part in location[:-1] if isinstance(part, str)):
        if part in forms:
            model = forms[part]
        elif part in model.model_fields:
            inner = models_in(model.model_fields[part].rebuild_annotation())
            model = inner[0] if inner else model
    return list(model.model_fields)


def models_in(annotation: Any) -> list[type[BaseModel]]:
    """List the models in a type annotation, in order."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return [annotation]
    return [model for inner in get_args(annotation) for model in models_in(inner)]
