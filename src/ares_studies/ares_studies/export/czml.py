# SPDX-License-Identifier: Apache-2.0
"""Export flights as CZML, for Cesium: JSON packets."""

import json
from collections.abc import Iterator
from typing import Any

import numpy as np

from ares_studies.export.globes import (
    BURNS,
    COAST,
    WIDTH,
    ExportTrack,
    about,
    coordinates_of,
    falls_of,
    moment,
    track_of,
)
from ares_studies.export.recording import Export


def as_czml(export: Export) -> bytes:
    """Write a CZML document: clock, vehicle with its path, a line per phase, events, falls."""
    track = track_of(export)
    begin, end = moment(export, track.time_s[0]), moment(export, track.time_s[-1])
    span = f"{begin}/{end}"
    packets = [
        {
            "id": "document",
            "name": export.title,
            "description": about(export),
            "version": "1.0",
            "clock": {
                "interval": span,
                "currentTime": begin,
                "multiplier": 10,
                "range": "LOOP_STOP",
                "step": "SYSTEM_CLOCK_MULTIPLIER",
            },
        },
        _vehicle(export, track, span),
        *_lines(export, track, end),
        *_events(export, end),
        *_falls(export, end),
    ]
    return json.dumps(packets, indent=1, allow_nan=False, ensure_ascii=False).encode()


def _colour(rgb: tuple[int, int, int]) -> dict[str, Any]:
    return {"rgba": [*rgb, 255]}


def _vehicle(export: Export, track: ExportTrack, span: str) -> dict[str, Any]:
    samples = [
        [round(time, 9), *place]
        for time, place in zip(track.time_s, track.coordinates, strict=True)
    ]
    return {
        "id": "vehicle",
        "name": export.recording.mission.title,
        "availability": span,
        "position": {
            "epoch": moment(export, 0.0),
            "interpolationAlgorithm": "LINEAR",
            "interpolationDegree": 1,
            "cartographicDegrees": np.ravel(samples).tolist(),
        },
        "point": {"pixelSize": 10, "color": _colour(BURNS[0])},
        "path": {
            "width": WIDTH,
            "leadTime": 0,
            "material": {"solidColor": {"color": _colour((255, 255, 255))}},
        },
    }


def _lines(export: Export, track: ExportTrack, end: str) -> Iterator[dict[str, Any]]:
    for number, phase in enumerate(track.phases):
        points = track.coordinates[phase.first : phase.last + 1]
        for kind, on_ground in (("phase", False), ("ground", True)):
            yield {
                "id": f"{kind}/{number}",
                "name": phase.name,
                "availability": f"{moment(export, phase.begin_s)}/{end}",
                "polyline": {
                    "positions": {"cartographicDegrees": np.ravel(points).tolist()},
                    "width": 1 if on_ground else WIDTH,
                    "arcType": "GEODESIC" if on_ground else "NONE",
                    "clampToGround": on_ground,
                    "material": {"solidColor": {"color": _colour(phase.colour)}},
                },
            }


def _events(export: Export, end: str) -> Iterator[dict[str, Any]]:
    places = coordinates_of(export.event_places())
    for number, (event, place) in enumerate(zip(export.events, places, strict=True)):
        begin = min(moment(export, event.time_s), end)
        yield {
            "id": f"event/{number}",
            "name": event.name,
            "description": f"t = {event.time_s:.3f} s, mass {event.mass_kg:,.1f} kg",
            "availability": f"{begin}/{end}",
            "position": {"cartographicDegrees": list(place)},
            "point": {"pixelSize": 6, "color": _colour((255, 255, 255))},
            "label": {
                "text": event.name,
                "font": "12px sans-serif",
                "pixelOffset": {"cartesian2": [8, -8]},
                "horizontalOrigin": "LEFT",
            },
        }


def _falls(export: Export, end: str) -> Iterator[dict[str, Any]]:
    for number, (fall, way) in enumerate(falls_of(export)):
        yield {
            "id": f"fall/{number}",
            "name": fall.title,
            "description": f"{fall.words}; {fall.speed_m_s:,.0f} m/s",
            "availability": f"{min(moment(export, fall.time_s), end)}/{end}",
            "position": {"cartographicDegrees": list(way[-1])},
            "point": {"pixelSize": 8, "color": _colour(COAST)},
            "polyline": {
                "positions": {"cartographicDegrees": np.ravel(way).tolist()},
                "width": 1,
                "arcType": "NONE",
                "material": {"solidColor": {"color": _colour(COAST)}},
            },
        }
