# SPDX-License-Identifier: Apache-2.0
"""Advice on text that is not YAML: a missing colon, a wrong indent, text that needs quotes."""

import re

import yaml

#: Longest row that a message repeats.
_SHOWN = 40

#: What a person can do about a complaint of the YAML parser, by words of it.
_HINTS = {
    "mapping values are not allowed": (
        "text with a colon stands in quotes, keys of one mapping begin in one column"
    ),
    r"'\t'": "lines are indented by spaces, not by tabs",
}
_NO_COLON = "while scanning a simple key"
_NOT_HERE = re.compile("mapping values are not allowed here|<document start>")
_NO_END = "expected <block end>"
#: Where the parser begins a new line.
_BREAK = re.compile("\r\n|[\r\n\x85\u2028\u2029]")
_ROW = re.compile(r"(?P<blanks> *)(?P<dashes>(?:- +)*)(?P<rest>.*)")


def advise(text: str, error: yaml.MarkedYAMLError) -> tuple[int | None, str]:
    """Return the line at fault, from 1, and what is wrong there, in one line.

    Args:
        text: that is not YAML.
        error: of the parser.
    """
    mark = error.problem_mark or error.context_mark
    line = mark.line if mark else None
    rows = _BREAK.split(text)
    problem = error.problem or ""
    if error.context == _NO_COLON and error.context_mark is not None:
        at = error.context_mark.line
        if at < len(rows) and _lacks_colon(rows[at]):
            return at + 1, _colon(rows[at])
    if line is not None and line < len(rows):
        before = _content_before(rows, line)
        if _NOT_HERE.search(problem) and before is not None and _lacks_colon(rows[before]):
            return before + 1, _colon(rows[before])
        if _NOT_HERE.search(problem) or _NO_END in problem:
            neighbour = _neighbour(rows, line, before)
            if neighbour is not None:
                return line + 1, _indent(rows, line, neighbour)
    what = " ".join(filter(None, (error.context, problem))).replace("\n", " ")
    hint = "".join(f"; {advice}" for words, advice in _HINTS.items() if words in what)
    return (None if line is None else line + 1), f"{what}{hint}"


def _parts(row: str) -> re.Match[str]:
    found = _ROW.match(row)
    assert found is not None
    return found


def _content_before(rows: list[str], line: int) -> int | None:
    """Return the last row before one that is neither empty nor a comment."""
    for k in range(line - 1, -1, -1):
        bare = rows[k].strip()
        if bare and not bare.startswith("#"):
            return k
    return None


def _lacks_colon(row: str) -> bool:
    """Tell whether a row begins with a name and has neither a colon nor what replaces one."""
    rest = _parts(row)["rest"].partition(" #")[0].rstrip()
    return re.match(r"\w", rest) is not None and re.search(r":( |$)", rest) is None


def _colon(row: str) -> str:
    rest = _parts(row)["rest"].partition(" #")[0].rstrip()
    shown = rest if len(rest) <= _SHOWN else f"{rest[: _SHOWN - 3]}..."
    missing = "a blank behind the colon" if re.match(r"\w+:\S", rest) else "a colon"
    return f"{shown!r} is no 'key: value'; is {missing} missing?"


def _neighbour(rows: list[str], line: int, before: int | None) -> int | None:
    """Return the row that one should be indented like, if it is not; else None."""
    here = _parts(rows[line])
    if here["dashes"]:
        items = [k for k in range(line) if _parts(rows[k])["dashes"]]
        other = items[-1] if items else None
        same = other is not None and here["blanks"] == _parts(rows[other])["blanks"]
    else:
        other = before
        same = other is not None and _column(rows[line]) == _column(rows[other])
    return None if same else other


def _column(row: str) -> int:
    """Return the column of the key of a row."""
    found = _parts(row)
    return len(found["blanks"]) + len(found["dashes"])


def _indent(rows: list[str], line: int, neighbour: int) -> str:
    if _parts(rows[line])["dashes"]:
        widths = [len(_parts(rows[k])["blanks"]) for k in (line, neighbour)]
        what = "items of one list"
    else:
        widths = [_column(rows[k]) for k in (line, neighbour)]
        what = "keys of one mapping"
    blanks = f"{widths[0]} blank{'s' if widths[0] != 1 else ''}"
    there = f"its neighbour in line {neighbour + 1} by {widths[1]}"
    return f"indented by {blanks}, {there}; {what} begin in one column"
