# SPDX-License-Identifier: Apache-2.0
"""JSON Schema of the input files, for editors.

A schema covers keys, types, ranges and choices, but not relations between keys: only the loaders
check those.
"""

import json

from pydantic import BaseModel
from pydantic.json_schema import GenerateJsonSchema, JsonSchemaValue
from pydantic_core.core_schema import NullableSchema, WithDefaultSchema

DIALECT = "https://json-schema.org/draft/2020-12/schema"


class _OfFiles(GenerateJsonSchema):
    """Write a schema in which nothing is null: a key of a file has a value or is left out."""

    def nullable_schema(self, schema: NullableSchema) -> JsonSchemaValue:
        return self.generate_inner(schema["schema"])

    def default_schema(self, schema: WithDefaultSchema) -> JsonSchemaValue:
        written = super().default_schema(schema).items()
        return {key: value for key, value in written if (key, value) != ("default", None)}


def json_schema(model: type[BaseModel], title: str) -> str:
    """Write the text of a JSON Schema file.

    Args:
        model: the schema.
        title: of the schema.
    """
    content = model.model_json_schema(schema_generator=_OfFiles)
    schema = {"$schema": DIALECT, **content, "title": title}
    return json.dumps(schema, indent=2) + "\n"
