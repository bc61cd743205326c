# SPDX-License-Identifier: Apache-2.0
"""Compare two bags, message by message, decoded."""

import math
from collections.abc import Iterable, Iterator
from itertools import zip_longest
from typing import Any

from ares_bags.decoded import leaves
from ares_bags.reader import Bag

#: Identities, which differ between two equal flights of one mission.
IDENTITIES = ("flight_id", "guidance_id", "hardware_id")


def _content(message: Any) -> Iterator[tuple[str, Any]]:
    for name, value in leaves(message):
        if name.rsplit(".", maxsplit=1)[-1] not in IDENTITIES:
            yield name, value


def _same(one: Any, other: Any) -> bool:
    if isinstance(one, float) and isinstance(other, float):
        return one == other or (math.isnan(one) and math.isnan(other))
    return bool(one == other)


def differences(
    one: Bag, other: Bag, topics: Iterable[str] | None = None, limit: int = 10
) -> list[str]:
    """List the differences between two bags; empty if they hold equal messages at equal times.

    Messages are compared decoded (CDR has padding of no meaning), exactly, NaN equal to NaN, and
    without the identities of flight and guidance. A topic without messages equals a missing topic.

    Args:
        one: a bag.
        other: a bag.
        topics: full names; default: every topic of either bag.
        limit: maximum number of lines.

    Returns:
        One line per difference.

    Raises:
        BagError: one of them is damaged.
    """
    lines: list[str] = []
    for topic in sorted({*one.topics, *other.topics} if topics is None else topics):
        sides = [bag.messages(topic) if topic in bag.topics else iter(()) for bag in (one, other)]
        for number, (left, right) in enumerate(zip_longest(*sides)):
            where = f"{topic} message {number}"
            if left is None or right is None:
                counts = [
                    bag.topics[topic].count if topic in bag.topics else 0 for bag in (one, other)
                ]
                lines.append(f"{topic}: {counts[0]} messages against {counts[1]}")
                break
            if left[0] != right[0]:
                lines.append(f"{where}: log time {left[0]} ns against {right[0]} ns")
            for (name, a), (other_name, b) in zip_longest(
                _content(left[1]), _content(right[1]), fillvalue=("", None)
            ):
                if name != other_name or not _same(a, b):
                    at = f"t {left[0] / 1e9:.3f} s"
                    lines.append(f"{where} ({at}): {name or other_name} {a!r} against {b!r}")
                    break
            if len(lines) >= limit:
                return lines[:limit]
    return lines[:limit]
