# SPDX-License-Identifier: Apache-2.0
"""Schemas of the files that people write as JSON Schema, for editors.

A schema knows keys, types, ranges and choices, not what several keys must be together: the
loaders have the last word.
"""

import json

from pydantic import BaseModel

DIALECT = "https://json-schema.org/draft/2020-12/schema"


def json_schema(model: type[BaseModel], title: str) -> str:
    """Text of a JSON Schema file.

    Args:
        model: the schema.
        title: what a file of it is.
    """
    schema = {"$schema": DIALECT, **model.model_json_schema(), "title": title}
    return json.dumps(schema, indent=2) + "\n"
