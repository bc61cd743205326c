# SPDX-License-Identifier: Apache-2.0
"""JSON Schema of the input files, for editors.

A schema covers keys, types, ranges and choices, but not relations between keys: only the loaders
check those.
"""

import json

from pydantic import BaseModel

DIALECT = "https://json-schema.org/draft/2020-12/schema"


def json_schema(model: type[BaseModel], title: str) -> str:
    """Write the text of a JSON Schema file.

    Args:
        model: the schema.
        title: of the schema.
    """
    schema = {"$schema": DIALECT, **model.model_json_schema(), "title": title}
    return json.dumps(schema, indent=2) + "\n"
