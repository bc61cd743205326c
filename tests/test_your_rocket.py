# SPDX-License-Identifier: Apache-2.0
"""docs/your_rocket.md, followed literally."""

import re
import shlex
from pathlib import Path

import pytest

PAGE = Path(__file__).parent.parent / "docs" / "your_rocket.md"
FILE = Path("my_rocket.yaml")
SKIPPED = "..."
#: The rest of the page is about one slip at a time, each taken back.
MISTAKES = "## Common mistakes"
#: What takes half a minute together.
SLOW = ("--maximize", "montecarlo")
NUMBER = re.compile(r"-?\d[\d,]*\.?\d*(?:e[-+]?\d+)?")


def blocks(text):
    """Return kind and lines of each code block, in order."""
    return [
        (kind, body.splitlines()) for kind, body in re.findall(r"```(\w+)\n(.*?)```", text, re.S)
    ]


def edit(lines):
    """Replace a line of the file, its comment left out, as a diff says."""
    old, new = (line[1:] for line in lines)
    text = FILE.read_text()
    found = re.findall(rf"^{re.escape(old)}(?=\s|$)", text, re.MULTILINE)
    assert len(found) == 1, old
    FILE.write_text(re.sub(rf"^{re.escape(old)}(?=\s|$)", new, text, flags=re.MULTILINE))


def numbers(line):
    return [float(found.replace(",", "")) for found in NUMBER.findall(line)]


def is_shown(shown, line):
    """Tell whether lines have equal words, and equal numbers except for the last digits."""
    if NUMBER.sub("#", shown).split() != NUMBER.sub("#", line).split():
        return False
    return numbers(line) == pytest.approx(numbers(shown), rel=1e-4)


def compare(shown, printed):
    """Assert that the lines shown are printed, consecutively unless dots allow a gap."""
    rest = iter([line for line in printed if line.strip()])
    free = False
    for wanted in shown:
        if wanted == SKIPPED:
            free = True
            continue
        for line in rest:
            if is_shown(wanted, line):
                break
            assert free, f"{wanted!r} is shown, {line!r} is printed"
        else:
            pytest.fail(f"{wanted!r} is shown, but not printed:\n" + "\n".join(printed))
        free = False
    assert free or list(rest) == []


def follow(lines, ares, left_out=()):
    """Run the commands of a block, but for some, and compare what each prints."""
    commands = [k for k, line in enumerate(lines) if line.startswith("$ ")]
    for begin, end in zip(commands, [*commands[1:], len(lines)], strict=True):
        program, *words = shlex.split(lines[begin].removeprefix("$ "))
        assert program == "./ares"
        if not set(words).isdisjoint(left_out):
            continue
        done = ares(*words)
        assert "Traceback" not in done.stderr
        refused = done.returncode == 2
        assert refused == lines[begin + 1].startswith("ares: ")
        compare(lines[begin + 1 : end], (done.stderr if refused else done.stdout).splitlines())


@pytest.mark.long
@pytest.mark.parametrize("left_out", [SLOW, pytest.param((), marks=pytest.mark.trial)])
def test_the_page_to_the_letter(tmp_path, monkeypatch, ares, left_out):
    monkeypatch.chdir(tmp_path)
    way, mistakes = PAGE.read_text().split(MISTAKES)
    edits = 0
    for kind, lines in blocks(way):
        if kind == "diff":
            edit(lines)
            edits += 1
        else:
            follow(lines, ares, left_out)
    assert edits == 4
    assert {path.name for path in tmp_path.iterdir()} == {
        *("my_rocket.yaml", "mission.schema.json", "my_flight"),
        *("my_rocket_dispersions.yaml", "dispersions.schema.json"),
        *(() if left_out else ("my_campaign",)),
    }
    right = FILE.read_text()
    for kind, lines in blocks(mistakes):
        if kind == "diff":
            edit(lines)
        else:
            follow(lines, ares)
            FILE.write_text(right)


def test_the_comparison_notices_what_differs():
    compare(["a 1.00 kg", SKIPPED, "c"], ["a   1.0000001 kg", "b", "c"])
    with pytest.raises(AssertionError, match="is printed"):
        compare(["a", "c"], ["a", "b", "c"])
    with pytest.raises(AssertionError):
        compare(["a"], ["a", "b"])
    for shown in (["a 2 kg"], ["b"], ["a 1 g"]):
        with pytest.raises(pytest.fail.Exception, match="not printed"):
            compare([SKIPPED, *shown], ["a 1 kg"])
