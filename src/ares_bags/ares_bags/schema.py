# SPDX-License-Identifier: Apache-2.0
"""Describe topics as a bag does: message definition, type hash, offered QoS.

Definition and hash come from the files that every interface package installs
(`share/<package>/msg/<Name>.msg` and `.json`), as rosbag2 does it.
"""

import json
import re
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

import yaml

from ares_bags.errors import BagError, cause

_PRIMITIVES = frozenset(
    ("bool", "byte", "char", "float32", "float64", "int8", "uint8", "int16", "uint16")
    + ("int32", "uint32", "int64", "uint64", "string", "wstring")
)
_SEPARATOR = "=" * 80
_TYPE_NAME = re.compile(r"([A-Za-z]\w*)/(?:msg/)?([A-Za-z]\w*)")
_FIELD = re.compile(r"^[ \t]*([A-Za-z][\w/]*)(?:<=\d+)?(?:\[[^\]]*\])?[ \t]+\w", re.MULTILINE)

#: Value with which rosbag2 writes an unlimited duration.
FOREVER_NS = 2**63 - 1


@dataclass(frozen=True)
class Qos:
    """Hold the QoS of a publisher in rosbag2's terms.

    Attributes:
        reliability: `reliable` or `best_effort`.
        durability: `volatile` or `transient_local`.
        history: `keep_last`, `keep_all` or `unknown`; discovery does not report it.
        depth: messages kept; 0 if unknown.
        liveliness: `automatic` or `manual_by_topic`.
        deadline_ns: ns; FOREVER_NS: no limit.
        lifespan_ns: ns; FOREVER_NS: no limit.
        liveliness_lease_ns: ns; FOREVER_NS: no limit.
    """

    reliability: str = "reliable"
    durability: str = "volatile"
    history: str = "unknown"
    depth: int = 0
    liveliness: str = "automatic"
    deadline_ns: int = FOREVER_NS
    lifespan_ns: int = FOREVER_NS
    liveliness_lease_ns: int = FOREVER_NS

    def as_dict(self) -> dict[str, Any]:
        """Return an entry of `offered_qos_profiles`, keys in rosbag2's order."""
        return {
            "history": self.history,
            "depth": self.depth,
            "reliability": self.reliability,
            "durability": self.durability,
            "deadline": _duration(self.deadline_ns),
            "lifespan": _duration(self.lifespan_ns),
            "liveliness": self.liveliness,
            "liveliness_lease_duration": _duration(self.liveliness_lease_ns),
            "avoid_ros_namespace_conventions": False,
        }

    @staticmethod
    def from_dict(entry: dict[str, Any]) -> "Qos":
        """Make a profile from an entry of `offered_qos_profiles`."""
        return Qos(
            reliability=str(entry["reliability"]),
            durability=str(entry["durability"]),
            history=str(entry["history"]),
            depth=int(entry["depth"]),
            liveliness=str(entry["liveliness"]),
            deadline_ns=_nanoseconds(entry["deadline"]),
            lifespan_ns=_nanoseconds(entry["lifespan"]),
            liveliness_lease_ns=_nanoseconds(entry["liveliness_lease_duration"]),
        )


@dataclass(frozen=True)
class Topic:
    """Hold a topic of a bag.

    Attributes:
        name: full name (`/ares/nav_state`).
        type_name: `package/msg/Name`.
        definition: ros2msg text with all dependencies.
        type_hash: `RIHS01_...`.
        qos: profiles of its publishers.
    """

    name: str
    type_name: str
    definition: str
    type_hash: str
    qos: tuple[Qos, ...] = ()

    @staticmethod
    def installed(name: str, type_name: str, qos: tuple[Qos, ...] = ()) -> "Topic":
        """Make a topic of a type that is installed here.

        Raises:
            BagError: the type is not installed.
        """
        return Topic(name, type_name, message_definition(type_name), type_hash(type_name), qos)


def _duration(nanoseconds: int) -> dict[str, int]:
    sec, nsec = divmod(nanoseconds, 10**9)
    return {"sec": sec, "nsec": nsec}


def _nanoseconds(entry: dict[str, int]) -> int:
    return int(entry["sec"]) * 10**9 + int(entry["nsec"])


def dump_yaml(value: object) -> str:
    """Return block-style YAML, keys in the order given."""
    return yaml.safe_dump(value, sort_keys=False, allow_unicode=True, width=2**20)


#: The loader in C where available, for speed: each bag needs several texts.
_LOADER = getattr(yaml, "CSafeLoader", yaml.SafeLoader)
#: Deepest nesting of a YAML text; most values with all aliases expanded.
_MAX_DEPTH = 32
_MAX_VALUES = 100_000
#: Errors of the loader for a scalar that does not match its tag.
_UNFIT = (AttributeError, LookupError, OverflowError, TypeError, ValueError)


def load_yaml(text: str) -> Any:
    """Parse a YAML text.

    Raises:
        ValueError: it is not YAML, or its size or nesting exceeds what a bag needs.
    """
    try:
        _check_size(text)
        return yaml.load(text, Loader=_LOADER)
    except (yaml.YAMLError, *_UNFIT) as error:
        raise ValueError(f"not valid YAML ({cause(error)})") from error


def _check_size(text: str) -> None:
    """Refuse a text that would overflow the loader's stack, or whose aliases expand without bound.

    Raises:
        ValueError: it does; one line.
    """
    # open collections: anchor, and number of values at their start
    opened: list[tuple[str | None, int]] = []
    sizes: dict[str, int] = {}
    values = 0
    for event in yaml.parse(text, Loader=_LOADER):
        if isinstance(event, yaml.AliasEvent):
            # an alias to an open anchor would contain itself
            values += sizes.get(str(event.anchor), _MAX_VALUES)
        elif isinstance(event, yaml.CollectionStartEvent):
            opened.append((event.anchor, values))
            values += 1
        elif isinstance(event, yaml.CollectionEndEvent):
            anchor, before = opened.pop()
            if anchor is not None:
                sizes[anchor] = values - before
        elif isinstance(event, yaml.ScalarEvent):
            values += 1
            if event.anchor is not None:
                sizes[event.anchor] = 1
        if values >= _MAX_VALUES or len(opened) > _MAX_DEPTH:
            raise ValueError("nested too deeply, or grown by its aliases")


@lru_cache
def qos_text(qos: tuple[Qos, ...]) -> str:
    """Return `offered_qos_profiles` of a channel: a YAML list as text; "" without profiles."""
    return dump_yaml([profile.as_dict() for profile in qos]) if qos else ""


@lru_cache
def qos_from_text(text: str) -> tuple[Qos, ...]:
    """Parse the profiles of a channel; leave out those of older rosbag2 versions (numbers).

    Raises:
        ValueError: the text is not a list of profiles.
    """
    try:
        entries = load_yaml(text) or []
        return tuple(Qos.from_dict(entry) for entry in entries if type(entry["history"]) is str)
    except (ValueError, TypeError, KeyError, OverflowError) as error:
        raise ValueError("offered_qos_profiles is not a list of QoS profiles") from error


def split_type_name(type_name: str) -> tuple[str, str]:
    """Return package and name of `package/msg/Name` or `package/Name`.

    Raises:
        BagError: it is neither.
    """
    match = _TYPE_NAME.fullmatch(type_name)
    if match is None:
        raise BagError(f"message type is {type_name!r}; expected package/msg/Name")
    return match[1], match[2]


def _interface_file(type_name: str, suffix: str) -> Path:
    from ament_index_python.packages import PackageNotFoundError, get_package_share_directory

    package, name = split_type_name(type_name)
    try:
        share = Path(get_package_share_directory(package))
    except PackageNotFoundError as error:
        raise BagError(f"message type {type_name}: package {package} is not installed") from error
    path = share / "msg" / (name + suffix)
    if not path.is_file():
        raise BagError(f"message type {type_name} is not installed: no {path}")
    return path


def _dependencies(text: str, package: str) -> list[str]:
    found = set()
    for match in _FIELD.finditer(text):
        kind = match[1]
        if kind not in _PRIMITIVES:
            found.add(kind if "/" in kind else f"{package}/{kind}")
    return sorted(found)


def message_definition(type_name: str) -> str:
    """Return the ros2msg text of a type: its own text, then each dependency once.

    Order and separators are rosbag2's: depth first, sorted by name within a message.

    Raises:
        BagError: the type, or one of its dependencies, is not installed.
    """
    seen: set[str] = set()

    def text_of(name: str) -> str:
        text = _interface_file(name, ".msg").read_text(encoding="utf-8")
        parts = [text]
        for dependency in _dependencies(text, split_type_name(name)[0]):
            if dependency not in seen:
                seen.add(dependency)
                parts.append(f"\n{_SEPARATOR}\nMSG: {dependency}\n{text_of(dependency)}")
        return "".join(parts)

    return text_of(type_name)


def type_hash(type_name: str) -> str:
    """Return the RIHS01 hash of a type, as computed when its package was built.

    Raises:
        BagError: the type is not installed, or its description is broken.
    """
    package, name = split_type_name(type_name)
    path = _interface_file(type_name, ".json")
    try:
        hashes = json.loads(path.read_text(encoding="utf-8"))["type_hashes"]
        by_name = {entry["type_name"]: str(entry["hash_string"]) for entry in hashes}
        return by_name[f"{package}/msg/{name}"]
    except (ValueError, KeyError, TypeError) as error:
        raise BagError(f"{path}: no type hash of {type_name}") from error
