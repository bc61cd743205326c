"""The table of docs/reliability.md, from what benchmarks/faults.py has kept.

python3 tools/reliability_table.py    writes it into the page
"""

import json
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parent.parent
PAGE = ROOT / "docs" / "reliability.md"
RESULT = ROOT / "benchmarks" / "results" / "faults.json"
BEGIN, END = "<!-- table: tools/reliability_table.py -->", "<!-- end of the table -->"
SUMS = ("injected", "survived", "degraded", "wrong")


def table(result: dict[str, Any]) -> str:
    """The table as Markdown, with the line that says when and on what it was made."""
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


def page(text: str, result: dict[str, Any]) -> str:
    """The page with the table of a result in place of its own."""
    before, _, rest = text.partition(BEGIN)
    _, _, after = rest.partition(END)
    return f"{before}{BEGIN}\n\n{table(result)}\n\n{END}{after}"


if __name__ == "__main__":
    PAGE.write_text(page(PAGE.read_text(), json.loads(RESULT.read_text())))
