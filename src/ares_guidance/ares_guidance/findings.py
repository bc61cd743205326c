# SPDX-License-Identifier: Apache-2.0
"""Text of detected failures and of impact-point avoidance."""

from typing import Any

from ares_guidance import arrays as layout

#: By kind; ratio: measured over expected thrust or acceleration; name: of the arc or jettison.
_WORDS = {
    layout.FOUND_ENGINE_LOST: (
        "engine lost in {name}: {ratio:.3f} of the thrust, the propellant lasts"
    ),
    layout.FOUND_THRUST_LOW: "thrust of {name} is {ratio:.3f} of what it was",
    layout.FOUND_EARLY_END: "{name}: shut down early, flying on with what is left",
    layout.FOUND_NO_IGNITION: "{name}: no ignition, flying on with what is left",
    layout.FOUND_STUCK_THROTTLE: "throttle of {name} is stuck: {ratio:.3f} of the limit",
    layout.FOUND_STUCK_JETTISON: "{name}: does not go, planning with its mass",
}
#: Reported when guidance abandons the target for the safe orbit.
SAFE_ORBIT = "the target is out of reach: flying to the safe orbit"
#: By mode of impact-point avoidance.
_AVOIDING = {
    layout.AVOID_CLEAR: "the impact point stays outside all areas",
    layout.AVOID_STEER: "the impact point is steered away from {name}",
    layout.AVOID_CUT: "cut-off at {time:.1f} s, before the impact point enters {name}",
    layout.AVOID_LOST: "the impact point cannot be kept clear of {name}",
}


def describe(found: Any, arcs: tuple[str, ...], jettisons: tuple[str, ...]) -> str:
    """Describe the last detected failure in one line.

    Args:
        found: record FOUND with at least one finding.
        arcs: a name for each arc.
        jettisons: a name for each jettison.
    """
    kind, index = int(found["kind"]), int(found["index"])
    names = jettisons if kind == layout.FOUND_STUCK_JETTISON else arcs
    return _WORDS[kind].format(name=names[index], ratio=float(found["ratio"]))


def describe_avoiding(avoid: Any, areas: tuple[str, ...]) -> str:
    """Describe the impact-point avoidance in one line; empty if none is needed.

    Args:
        avoid: record AVOID.
        areas: a name for each area.
    """
    words = _AVOIDING.get(int(avoid["mode"]))
    if words is None:
        return ""
    name, time = areas[int(avoid["area"])], float(avoid["cutoff_time"])
    return "no safe orbit is in reach: " + words.format(name=name, time=time)


def aims_at_safe_orbit(state: Any) -> bool:
    """Return whether guidance aims at the safe orbit, of a record GUIDANCE_STATE."""
    return bool(state["aim"] == layout.AIM_SAFE)
