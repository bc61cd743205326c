# SPDX-License-Identifier: Apache-2.0
"""Write tables of benchmark results into pages: faults in flights, flights over a link.

python3 tools/page_tables.py    updates the pages
"""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

ROOT = Path(__file__).resolve().parent.parent
BEGIN, END = "<!-- table: tools/page_tables.py -->", "<!-- end of the table -->"
SUMS = ("injected", "survived", "degraded", "wrong")


def faults(result: dict[str, Any]) -> str:
    """Format the table of benchmarks/faults.py, with a line on date and machine."""
    made = f"{result['injected']:,} faults, seed {result['seed']}; {result['measured']}, "
    again = "; ".join(result.get("flown_again", ()))
    lines = [
        made + f"{result['machine']}." + (f" Flown again after a mend: {again}." if again else ""),
        "",
        "| fault | expected | " + " | ".join(SUMS) + " |",
        "|---|---|" + "---|" * len(SUMS),
    ]
    whole = {**result, "row": "all", "expected": ""}
    for row in (*result["rows"], whole):
        numbers = " | ".join(str(row[key]) for key in SUMS)
        lines.append(f"| {row['row']} | {row['expected']} | {numbers} |")
    return "\n".join(lines)


def latency(result: dict[str, Any]) -> str:
    """Format the table of benchmarks/latency.py: final masses, or the verdict off target."""
    losses = sorted({row["loss"] for row in result["rows"]})
    flights = {(row["law"], row["latency_s"], row["loss"]): row for row in result["rows"]}
    lines = [
        f"{len(flights)} flights; {result['measured']}, {result['machine']}.",
        "",
        "| law | one way, ms | " + " | ".join(f"{loss:.0%} lost" for loss in losses) + " |",
        "|---|---|" + "---|" * len(losses),
    ]
    for law, delay in dict.fromkeys((row["law"], row["latency_s"]) for row in result["rows"]):
        cells = [_flight(flights.get((law, delay, loss))) for loss in losses]
        lines.append(f"| `{law}` | {1e3 * delay:,.0f} | " + " | ".join(cells) + " |")
    return "\n".join(lines)


def _flight(row: dict[str, Any] | None) -> str:
    if row is None:
        return "not flown"
    words = [] if row["outcome"] == "target" else [row["outcome"].replace("_", " ")]
    if row["status"] and not words:
        words = [f"status {row['status']}"]
    return ", ".join([f"{row['mass_kg']:,.1f}", *words])


class Table(NamedTuple):
    """Define one table.

    Attributes:
        page: file that holds it.
        result: file of the benchmark's results.
        make: formats it in Markdown.
    """

    page: Path
    result: Path
    make: Callable[[dict[str, Any]], str]

    def filled(self) -> str:
        """Return the page with the new table."""
        made = self.make(json.loads(self.result.read_text()))
        before, _, rest = self.page.read_text().partition(BEGIN)
        _, _, after = rest.partition(END)
        return f"{before}{BEGIN}\n\n{made}\n\n{END}{after}"


KEPT = ROOT / "benchmarks" / "results"
TABLES = (
    Table(ROOT / "docs" / "reliability.md", KEPT / "faults.json", faults),
    Table(ROOT / "docs" / "hardware_in_the_loop.md", KEPT / "latency.json", latency),
)

if __name__ == "__main__":
    for table in TABLES:
        table.page.write_text(table.filled())
