# SPDX-License-Identifier: Apache-2.0
"""Ranges of the numbers in an input file."""

from dataclasses import dataclass
from typing import Any

from pydantic import GetCoreSchemaHandler, GetJsonSchemaHandler
from pydantic.json_schema import JsonSchemaValue
from pydantic_core import CoreSchema, PydanticCustomError, core_schema

from ares_models.input_file import format_number


@dataclass(frozen=True)
class Range:
    """Bound a number, both ends included; in a model: ``Annotated[float, Range(0.0, 1.0)]``.

    An integer is accepted as a float; a boolean or a text is no number; nan is in no range.

    Attributes:
        low: least value.
        high: greatest value.
    """

    low: float
    high: float

    def __str__(self) -> str:
        return f"{format_number(self.low)} to {format_number(self.high)}"

    def __get_pydantic_core_schema__(
        self, source: Any, handler: GetCoreSchemaHandler
    ) -> CoreSchema:
        """Build the schema of an int or a float with the range check."""
        if source is int:
            inner: CoreSchema = core_schema.int_schema(strict=True)
        else:
            inner = core_schema.float_schema(strict=True, allow_inf_nan=False)
        noun = "an integer" if source is int else "a number"

        def check(value: float) -> float:
            if self.low <= value <= self.high:
                return value
            raise PydanticCustomError(
                "out_of_range",
                "{noun} from {low} to {high}",
                {"noun": noun, "low": format_number(self.low), "high": format_number(self.high)},
            )

        return core_schema.no_info_after_validator_function(check, inner)

    def __get_pydantic_json_schema__(
        self, schema: CoreSchema, handler: GetJsonSchemaHandler
    ) -> JsonSchemaValue:
        """Add the bounds to the JSON schema, for editors."""
        return handler(schema) | {"minimum": self.low, "maximum": self.high}
