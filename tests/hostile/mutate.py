# SPDX-License-Identifier: Apache-2.0
"""Hostile bytes, texts, numbers and YAML, made from valid ones."""

import math
from collections.abc import Callable, Sequence
from random import Random
from typing import Any

import yaml

#: Numbers that programs stumble over.
NUMBERS = (
    *(0.0, -0.0, 1.0, -1.0, 1e-300, -1e-300, 5e-324, 1e300, -1e300, 1.7e308),
    *(math.nan, math.inf, -math.inf, 2.0**31, 2.0**32, 2.0**53, 2.0**63, 2.0**64, 1e9, 6.4e6),
)
WHOLE = (0, 1, -1, 2, 7, 8, 9, 127, 128, 255, 256, 2**15, 2**16, 2**31 - 1, 2**31, 2**32 - 1, 2**32)
#: Texts that programs stumble over.
TEXTS = (
    "",
    " ",
    "a\nb",
    "\r\n",
    "\t",
    "\x00",
    "\x1b[31mred\x1b[0m",
    "\u202eright to left",
    "e\u0301",
    "\U0001f680",
    "\ud7ff\ue000",
    "\ud800",
    "\udcff",
    "\u2066left\u2069\u200f",
    "a\u0000b",
    "\u2028",
    "x" * 70_000,
    "\ufeff",
    "x" * 300,
    "\u00df" * 70,
    "%s%n%x",
    "{0}{name}",
    "<script>alert(1)</script>",
    "'; --",
    "${HOME}",
    "$(id)",
    "[red]rich[/red]",
    "[/nope]",
    "NaN",
    "Infinity",
    "-1",
    "1e999",
    "0x10",
    "true",
    "null",
    "~",
    "../../../etc/passwd",
    "/etc/passwd",
    "/dev/zero",
    "/dev/stdin",
    "/proc/self/environ",
    "/",
    ".",
    "..",
    "~root",
    "C:\\con",
    "file:///etc/passwd",
    "ares_v",
    "ARES_V",
    "ares_v.yaml",
    "a/" * 2000,
    "../" * 40 + "etc/passwd",
    "..%2f..%2fetc",
    "-",
    "--help",
    "con:/",
    "engine_out:time=200,thrust_ratio=0.8",
)
_BYTES = (b"\x00", b"\xff", b"\x80", b"\xfe\xff", b"\xff\xff\xff\xff", b"\x7f", b"\n", b"\x00" * 16)
_YAML = (
    "&a [*a]",
    "*nobody",
    "!!python/object/apply:os.system [id]",
    "!!timestamp no",
    "!!int ''",
    "!!float x",
    "!!bool maybe",
    "!!binary =",
    "!!omap [a: 1]",
    "!!python/name:os.system",
    "!include /etc/passwd",
    "&a {<<: *a}",
    "&a {b: *a}",
    "{<<: [&x {a: 1}, *x]}",
    "{engines: 1, engines: 2}",
    '"\\U00110000"',
    '"\\udcff"',
    "!!set {a, b}",
    "!<tag:x> y",
    "? [1, 2]\n: 3",
    "<<: {a: 1}",
    "2001-99-99",
    "2001-01-01T00:00:00Z",
    "- a\n- b",
    "|\n  text",
    ">-\n  text",
    "{a: 1, a: 2}",
    "[" * 40 + "]" * 40,
    "[" * 5000,
    "{a: " * 3000,
    "- " * 3000,
    "1" * 30,
    "1" * 5000,
    "0." + "1" * 400,
    "1e400",
    "-.inf",
    ".nan",
    "010",
    "0o17",
    "1_000",
    "1:30",
    "yes",
    '"\\ud800"',
    '"\\x00"',
    "'\u2028'",
    "---\na: 1",
    "...",
    "%YAML 1.1",
    "#",
    "\t- tab",
)


def bomb(random: Random) -> str:
    """Write YAML that grows when its aliases are expanded."""
    depth, width = random.randint(3, 12), random.randint(2, 12)
    lines = ["a0: &a0 [x" + ", x" * width + "]"]
    lines += [f"a{k}: &a{k} [*a{k - 1}" + f", *a{k - 1}" * width + "]" for k in range(1, depth + 1)]
    return "\n".join(lines) + "\n"


def number(random: Random, near: float = 1.0) -> float:
    """Draw a number: odd, random, or close to a valid one."""
    kind = random.random()
    if kind < 0.3:
        return random.choice(NUMBERS)
    if kind < 0.5:
        return random.uniform(-1.0, 1.0) * 10.0 ** random.randint(-12, 30)
    if kind < 0.8:
        return near * random.choice((0.5, 0.9, 0.99, 1.01, 1.1, 2.0, -1.0, 10.0, 1e-3, 1e3))
    return near + random.gauss(0.0, 1.0) * 10.0 ** random.randint(-9, 6)


def text(random: Random) -> str:
    """Draw a text: odd, or of odd characters."""
    if random.random() < 0.7:
        return random.choice(TEXTS)
    letters = random.choice(
        ("ab_/.-", "\u00e9\u4e2d\U0001f600", "\x00\x01\x7f\n", "0123456789.eE+-")
    )
    return "".join(random.choice(letters) for _ in range(random.randint(0, 40)))


# ---- bytes


def _cut(data: bytes, random: Random) -> bytes:
    return data[: random.randint(0, len(data))]


def _flip(data: bytes, random: Random) -> bytes:
    changed = bytearray(data)
    for _ in range(random.choice((1, 1, 1, 2, 8, 64))):
        if changed:
            changed[random.randrange(len(changed))] ^= 1 << random.randrange(8)
    return bytes(changed)


def _overwrite(data: bytes, random: Random) -> bytes:
    at = random.randint(0, len(data))
    piece = random.choice(
        (
            random.choice(_BYTES),
            random.randbytes(random.randint(1, 64)),
            random.choice(WHOLE[:10]).to_bytes(8, "little", signed=True),
            (random.choice(WHOLE) % 2**32).to_bytes(4, "little"),
            (2**64 - random.randint(1, 300)).to_bytes(8, "little"),
        )
    )
    return data[:at] + piece + data[at + len(piece) :]


def _insert(data: bytes, random: Random) -> bytes:
    at = random.randint(0, len(data))
    return data[:at] + random.choice(_BYTES) * random.choice((1, 1, 3, 100)) + data[at:]


def _delete(data: bytes, random: Random) -> bytes:
    at = random.randint(0, len(data))
    return data[:at] + data[at + random.choice((1, 2, 8, 100, 1000)) :]


def _double(data: bytes, random: Random) -> bytes:
    at = random.randint(0, len(data))
    end = at + random.choice((1, 8, 100, 1000))
    return data[:end] + data[at:end] + data[end:]


_ON_BYTES: Sequence[Callable[[bytes, Random], bytes]] = (
    *(_flip, _flip, _overwrite, _overwrite, _cut, _insert, _delete, _double),
)


def changed(data: bytes, random: Random) -> bytes:
    """Damage bytes in a few places."""
    for _ in range(random.choice((1, 1, 1, 2, 4))):
        data = random.choice(_ON_BYTES)(data, random)
    return data


# ---- texts of YAML


def _line_changed(lines: list[str], random: Random) -> None:
    at = random.randrange(len(lines))
    key, colon, value = lines[at].partition(":")
    kind = random.random()
    if kind < 0.2:
        del lines[at]
    elif kind < 0.35:
        lines.insert(at, lines[random.randrange(len(lines))])
    elif kind < 0.5 and colon:
        lines[at] = f"{key}: {random.choice(_YAML)}"
    elif kind < 0.7 and colon:
        lines[at] = f"{key}: {_scalar_text(value, random)}"
    elif kind < 0.8:
        lines[at] = " " * random.randint(0, 6) + lines[at].lstrip()
    elif kind < 0.9 and colon:
        lines[at] = f"{key}{text(random)}:{value}"
    else:
        lines.insert(at, random.choice(_YAML))


def _scalar_text(value: str, random: Random) -> str:
    try:
        return repr(number(random, float(value)))
    except ValueError:
        return random.choice((repr(number(random)), text(random), f'"{text(random)}"'))


def yaml_text(good: str, random: Random) -> bytes:
    """Damage the text of a YAML file."""
    kind = random.random()
    if kind < 0.02:
        return bomb(random).encode()
    if kind < 0.05:
        return (good + bomb(random)).encode()
    if kind < 0.25:
        return changed(good.encode(), random)
    lines = good.splitlines()
    for _ in range(random.choice((1, 1, 2, 3, 8))):
        if lines:
            _line_changed(lines, random)
    return "\n".join(lines).encode("utf-8", "surrogatepass")


# ---- structure of YAML


def _places(value: Any, found: list[tuple[Any, Any]]) -> list[tuple[Any, Any]]:
    """Collect containers and keys of everything inside a value."""
    keys = value.keys() if isinstance(value, dict) else range(len(value))
    for key in keys:
        found.append((value, key))
        if isinstance(value[key], (dict, list)):
            _places(value[key], found)
    return found


def _any_value(value: Any, random: Random) -> Any:
    if isinstance(value, (int, float)) and not isinstance(value, bool):
        return number(random, float(value))
    return random.choice(
        (None, True, [], {}, [1.0, 2.0, 3.0], {"a": 1}, text(random), number(random), [value])
    )


def yaml_structure(good: Any, random: Random) -> bytes:
    """Change values, keys or lists of a YAML file; `good` is modified."""
    for _ in range(random.choice((1, 1, 1, 2, 3, 6))):
        places = _places(good, [])
        if not places:
            break
        where, key = random.choice(places)
        kind = random.random()
        if kind < 0.6:
            where[key] = _any_value(where[key], random)
        elif kind < 0.75:
            del where[key]
        elif kind < 0.9 and isinstance(where, list):
            where.extend([where[key]] * random.choice((1, 2, 30)))
        elif isinstance(where, dict):
            where[text(random)] = where[key]
        else:
            random.shuffle(where)
    return yaml.safe_dump(good, allow_unicode=True, sort_keys=False).encode("utf-8", "replace")
