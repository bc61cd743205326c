# SPDX-License-Identifier: Apache-2.0
"""Ranges of the numbers in a file that people write."""

from dataclasses import dataclass
from typing import Any

from pydantic import GetCoreSchemaHandler, GetJsonSchemaHandler
from pydantic.json_schema import JsonSchemaValue
from pydantic_core import CoreSchema, PydanticCustomError, core_schema

from ares_models.input_file import format_number


@dataclass(frozen=True)
class Range:
    """Bounds of a number, both allowed; in a model: ``Annotated[float, Range(0.0, 1.0)]``.

    An integer stands for a float, a truth value or a text for neither; nan is in no range.

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
        """Of an int or a float."""
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
        """The bounds for editors."""
        return handler(schema) | {"minimum": self.low, "maximum": self.high}
