# SPDX-License-Identifier: Apache-2.0
"""Export flights as KML 2.2, for Google Earth and maps, elements in the order of its schema."""

from collections.abc import Sequence
from xml.etree import ElementTree
from xml.etree.ElementTree import Element, SubElement

from ares_studies.export.globes import (
    WIDTH,
    ExportTrack,
    about,
    coordinates_of,
    falls_of,
    moment,
    track_of,
)
from ares_studies.export.recording import Export
from ares_studies.montecarlo.footprints import SHARE, Footprint

KML = "http://www.opengis.net/kml/2.2"
#: Google's extensions: a track with a time at each point.
GX = "http://www.google.com/kml/ext/2.2"

Place = tuple[float, float, float]


def as_kml(export: Export) -> bytes:
    """Write KML: a track coloured by phase, the ground track, a placemark per event and fall."""
    track = track_of(export)
    root = Element("kml", {"xmlns": KML, "xmlns:gx": GX})
    document = _named(root, "Document", export.title)
    _text(document, "description", about(export))
    for number, phase in enumerate(track.phases):
        for kind, width in (("flight", WIDTH), ("ground", 1)):
            style = SubElement(document, "Style", {"id": f"{kind}-{number}"})
            line = SubElement(style, "LineStyle")
            red, green, blue = phase.colour
            _text(line, "color", f"ff{blue:02x}{green:02x}{red:02x}")
            _text(line, "width", str(width))
    end = moment(export, track.time_s[-1])
    flight = _named(document, "Folder", "flight")
    ground = _named(document, "Folder", "ground track")
    for number, phase in enumerate(track.phases):
        points = track.coordinates[phase.first : phase.last + 1]
        span = moment(export, phase.begin_s), end
        line = _line(flight, phase.name, span, f"flight-{number}")
        _points(line, "absolute", points)
        line = _line(ground, phase.name, span, f"ground-{number}")
        _text(line, "tessellate", "1")
        _points(line, "clampToGround", points)
    _vehicle(document, export, track)
    events = _named(document, "Folder", "events")
    places = coordinates_of(export.event_places())
    for event, place in zip(export.events, places, strict=True):
        mark = _named(events, "Placemark", event.name)
        _text(mark, "description", f"t = {event.time_s:.3f} s, mass {event.mass_kg:,.1f} kg")
        _span(mark, moment(export, event.time_s), end)
        _points(SubElement(mark, "Point"), "absolute", [place])
    _falls(document, export)
    ElementTree.indent(root)
    return ElementTree.tostring(root, encoding="UTF-8", xml_declaration=True)


def _falls(document: Element, export: Export) -> None:
    """Add the way of each piece to the ground, and a placemark where it comes down."""
    falls = list(falls_of(export))
    if not falls:
        return
    folder = _named(document, "Folder", "where stages come down")
    for fall, way in falls:
        mark = _named(folder, "Placemark", fall.title)
        _text(mark, "description", f"{fall.words}; {fall.speed_m_s:,.0f} m/s")
        both = SubElement(mark, "MultiGeometry")
        _points(SubElement(both, "Point"), "clampToGround", way[-1:])
        _points(SubElement(both, "LineString"), "absolute", way)


def _text(parent: Element, tag: str, text: str) -> None:
    SubElement(parent, tag).text = text


def _named(parent: Element, tag: str, name: str) -> Element:
    element = SubElement(parent, tag)
    _text(element, "name", name)
    return element


def _span(feature: Element, begin: str, end: str) -> None:
    span = SubElement(feature, "TimeSpan")
    _text(span, "begin", begin)
    _text(span, "end", end)


def _line(folder: Element, name: str, span: tuple[str, str], style: str) -> Element:
    """Add a line that appears when it is flown and stays; its points follow."""
    mark = _named(folder, "Placemark", name)
    _span(mark, *span)
    _text(mark, "styleUrl", f"#{style}")
    return SubElement(mark, "LineString")


def _points(geometry: Element, mode: str, points: Sequence[Place]) -> None:
    _text(geometry, "altitudeMode", mode)
    _text(geometry, "coordinates", " ".join(f"{x},{y},{z}" for x, y, z in points))


def _vehicle(document: Element, export: Export, track: ExportTrack) -> None:
    """Add a marker that moves with time."""
    mark = _named(document, "Placemark", export.recording.mission.title)
    element = SubElement(mark, "gx:Track")
    _text(element, "altitudeMode", "absolute")
    for time in track.time_s:
        _text(element, "when", moment(export, time))
    for x, y, z in track.coordinates:
        _text(element, "gx:coord", f"{x} {y} {z}")


def footprints_kml(title: str, footprints: Sequence[Footprint]) -> bytes:
    """Write KML of a campaign: for each piece a placemark at the mean and the ellipse."""
    root = Element("kml", {"xmlns": KML})
    document = _named(root, "Document", title)
    _text(document, "description", f"Where pieces come down, ellipses of {100 * SHARE:g} %.")
    for footprint in footprints:
        mark = _named(document, "Placemark", footprint.name)
        _text(mark, "description", footprint.words)
        both = SubElement(mark, "MultiGeometry")
        mean = (round(footprint.longitude_deg, 6), round(footprint.latitude_deg, 6), 0.0)
        _points(SubElement(both, "Point"), "clampToGround", [mean])
        if outline := footprint.outline():
            line = SubElement(both, "LineString")
            _text(line, "tessellate", "1")
            _points(line, "clampToGround", [(round(x, 6), round(y, 6), 0.0) for y, x in outline])
    ElementTree.indent(root)
    return ElementTree.tostring(root, encoding="UTF-8", xml_declaration=True)
