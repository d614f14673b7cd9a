"""Advice as files for the field: DJI's WPML missions, KML, GeoJSON, and a table.

WPML as published by DJI ("DJI WPML", Cloud API documentation, namespace 1.0.2): a KMZ of `wpmz/template.kml`, which programs
edit, and `wpmz/waylines.wpml`, which the drone flies. Heights there are above the take-off point. They are counted from the
lowest ground of the scene: whoever takes off higher flies higher by that, and whoever takes off lower flies lower.
"""

from __future__ import annotations

import csv
import io
import json
import math
import zipfile
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from xml.etree import ElementTree

import numpy as np
from jaxtyping import Float

from aug3d_core.advice.choice import Advised
from aug3d_core.geometry.geodesy import geodetic_from_enu

MOST_POINTS = 120  # of a mission
_KML, _WPML = "http://www.opengis.net/kml/2.2", "http://www.dji.com/wpmz/1.0.2"
_DRONE = {
    "droneEnumValue": 77,
    "droneSubEnumValue": 0,
}  # Mavic 3 Enterprise; programs ask for another when they open the file
_CAMERA = {"payloadEnumValue": 66, "payloadSubEnumValue": 0, "payloadPositionIndex": 0}
_SPEED_M_S, _TRANSIT_M_S = 5, 10
_ZIP_TIME = (1980, 1, 1, 0, 0, 0)  # the same advice makes the same bytes
_STOP = "toPointAndStopWithDiscontinuityCurvature"
ElementTree.register_namespace("", _KML)
ElementTree.register_namespace("wpml", _WPML)


@dataclass(frozen=True)
class Waypoint:
    """Where a photograph is taken. alt_m: NaN where no altitude is known. up_m: above the lowest ground of the scene."""

    lat_deg: float
    lon_deg: float
    alt_m: float
    up_m: float
    yaw_deg: float
    pitch_deg: float
    rank: int


def waypoints(
    advised: Sequence[Advised], origin_geodetic: Float[np.ndarray, " 3"], lowest_ground_m: float, altitude: bool = True
) -> list[Waypoint]:
    """Return places on earth, in the order given.

    lowest_ground_m: height in the scene's world. altitude: whether that of the origin is known.
    """
    found = []
    for one in advised:
        lat, lon, alt = (float(value) for value in geodetic_from_enu(np.array(one.xyz), origin_geodetic))
        yaw = (one.yaw_deg + 180) % 360 - 180
        alt = alt if altitude else math.nan
        found.append(Waypoint(lat, lon, alt, one.xyz[2] - lowest_ground_m, yaw, one.pitch_deg, one.rank))
    return found


def missions(points: Sequence[Waypoint], clear_m: float) -> Iterator[tuple[str, bytes]]:
    """Yield the name and the bytes of KMZ files with at most MOST_POINTS points each.

    clear_m: height above the lowest ground of the scene that is above all that is known.
    """
    parts = [points[i : i + MOST_POINTS] for i in range(0, len(points), MOST_POINTS)]
    for number, part in enumerate(parts, 1):
        packed = io.BytesIO()
        with zipfile.ZipFile(packed, "w", zipfile.ZIP_DEFLATED) as kmz:
            for file, root in (("template.kml", _template(part, clear_m)), ("waylines.wpml", _waylines(part, clear_m))):
                kmz.writestr(zipfile.ZipInfo(f"wpmz/{file}", _ZIP_TIME), _text(root), zipfile.ZIP_DEFLATED)
        yield f"mission_{number}.kmz" if len(parts) > 1 else "mission.kmz", packed.getvalue()


def kml(points: Sequence[Waypoint], title: str) -> bytes:
    """Return places and the way through them for Google Earth and the like; altitudes as the photographs' GPS has them.

    Where it has none, heights are those above the lowest ground.
    """
    root, document = _document()
    mode = "relativeToGround" if any(math.isnan(point.alt_m) for point in points) else "absolute"
    _add(document, "name", title, _KML)
    for point in points:
        mark = _add(document, "Placemark", None, _KML)
        _add(mark, "name", f"{point.rank}", _KML)
        _add(mark, "description", f"heading {round(point.yaw_deg) % 360} deg, gimbal {point.pitch_deg:.0f} deg", _KML)
        place = _add(mark, "Point", None, _KML)
        _add(place, "altitudeMode", mode, _KML)
        _add(place, "coordinates", _place(point), _KML)
    line = _add(_add(document, "Placemark", None, _KML), "LineString", None, _KML)
    _add(line, "altitudeMode", mode, _KML)
    _add(line, "coordinates", " ".join(map(_place, points)), _KML)
    return _text(root)


def geojson(points: Sequence[Waypoint], advised: Sequence[Advised]) -> str:
    """Return places as points (longitude, latitude, and altitude if it is known), in the order of the route."""
    features = []
    for order, (point, one) in enumerate(zip(points, advised, strict=True), 1):
        told = {"order": order, "up_m": round(point.up_m, 2)}
        told |= {name: value for name, value in asdict(one).items() if name != "xyz"}
        place = [round(point.lon_deg, 8), round(point.lat_deg, 8)]
        place += [] if math.isnan(point.alt_m) else [round(point.alt_m, 2)]
        features.append({"type": "Feature", "geometry": {"type": "Point", "coordinates": place}, "properties": told})
    return json.dumps({"type": "FeatureCollection", "features": features}, indent=1)


def listing(advised: Sequence[Advised], points: Sequence[Waypoint] | None) -> str:
    """Return the table of photographs, in the order of the route; on earth where points are given."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(
        ["order", "rank", "x", "y", "z", "yaw_deg", "pitch_deg", "adds", "poor", "hole", "error"]
        + (["lat_deg", "lon_deg", "alt_m", "up_m"] if points else [])
    )
    for order, one in enumerate(advised):
        row = [
            order + 1,
            one.rank,
            *(f"{value:.3f}" for value in one.xyz),
            f"{one.yaw_deg:.1f}",
            f"{one.pitch_deg:.1f}",
        ]
        row += [f"{value:.4f}" for value in (one.adds, one.poor, one.hole, one.error)]
        if points:
            point = points[order]
            row += [
                f"{point.lat_deg:.8f}",
                f"{point.lon_deg:.8f}",
                "" if math.isnan(point.alt_m) else f"{point.alt_m:.2f}",
            ]
            row.append(f"{point.up_m:.2f}")
        writer.writerow(row)
    return text.getvalue()


def _template(points: Sequence[Waypoint], clear_m: float) -> ElementTree.Element:
    """Return what programs for missions read and edit."""
    root, document = _document()
    _add(document, "author", "aug3d")
    _mission(document, points, clear_m)
    folder = _add(document, "Folder", None, _KML)
    _add_all(folder, {"templateType": "waypoint", "templateId": 0})
    system = _add(folder, "waylineCoordinateSysParam")
    _add_all(system, {"coordinateMode": "WGS84", "heightMode": "relativeToStartPoint", "positioningType": "GPS"})
    _add_all(
        folder,
        {"autoFlightSpeed": _SPEED_M_S, "globalHeight": _m(points[0].up_m), "gimbalPitchMode": "usePointSetting"},
    )
    _heading(_add(folder, "globalWaypointHeadingParam"), points[0])
    _add_all(folder, {"globalWaypointTurnMode": _STOP, "globalUseStraightLine": 1})
    for index, point in enumerate(points):
        mark = _mark(folder, index, point)
        _add_all(
            mark,
            {"ellipsoidHeight": _m(point.up_m), "height": _m(point.up_m), "useGlobalHeight": 0, "useGlobalSpeed": 1},
        )
        _add_all(mark, {"useGlobalHeadingParam": 0})
        _heading(_add(mark, "waypointHeadingParam"), point)
        _add_all(mark, {"useGlobalTurnParam": 1, "gimbalPitchAngle": _m(point.pitch_deg)})
        _photograph(mark, index, point)
    return root


def _waylines(points: Sequence[Waypoint], clear_m: float) -> ElementTree.Element:
    """Return what the drone flies."""
    root, document = _document()
    _mission(document, points, clear_m)
    folder = _add(document, "Folder", None, _KML)
    _add_all(
        folder,
        {"templateId": 0, "executeHeightMode": "relativeToStartPoint", "waylineId": 0, "autoFlightSpeed": _SPEED_M_S},
    )
    for index, point in enumerate(points):
        mark = _mark(folder, index, point)
        _add_all(mark, {"executeHeight": _m(point.up_m), "waypointSpeed": _SPEED_M_S})
        _heading(_add(mark, "waypointHeadingParam"), point)
        _add_all(_add(mark, "waypointTurnParam"), {"waypointTurnMode": _STOP, "waypointTurnDampingDist": 0})
        _add_all(mark, {"useStraightLine": 1})
        _photograph(mark, index, point)
    return root


def _mission(document: ElementTree.Element, points: Sequence[Waypoint], clear_m: float) -> None:
    """Say how the drone gets there and home, nobody knows from where: above all that is known, and the lowest point."""
    config = _add(document, "missionConfig")
    height = _m(max(clear_m, min(point.up_m for point in points)))
    _add_all(
        config,
        {
            "flyToWaylineMode": "safely", "finishAction": "goHome", "exitOnRCLost": "executeLostAction",
            "executeRCLostAction": "goBack", "takeOffSecurityHeight": height, "globalTransitionalSpeed": _TRANSIT_M_S,
            "globalRTHHeight": height,
        },
    )  # fmt: skip
    _add_all(_add(config, "droneInfo"), _DRONE)
    _add_all(_add(config, "payloadInfo"), _CAMERA)


def _mark(folder: ElementTree.Element, index: int, point: Waypoint) -> ElementTree.Element:
    mark = _add(folder, "Placemark", None, _KML)
    _add(_add(mark, "Point", None, _KML), "coordinates", f"{point.lon_deg:.8f},{point.lat_deg:.8f}", _KML)
    _add(mark, "index", str(index))
    return mark


def _heading(param: ElementTree.Element, point: Waypoint) -> None:
    _add_all(
        param,
        {
            "waypointHeadingMode": "smoothTransition", "waypointHeadingAngle": round(point.yaw_deg),
            "waypointHeadingPathMode": "followBadArc",
        },
    )  # fmt: skip


def _photograph(mark: ElementTree.Element, index: int, point: Waypoint) -> None:
    """Turn the camera, then take the photograph, once the drone stands."""
    group = _add(mark, "actionGroup")
    _add_all(
        group,
        {
            "actionGroupId": index, "actionGroupStartIndex": index, "actionGroupEndIndex": index,
            "actionGroupMode": "sequence",
        },
    )  # fmt: skip
    _add(_add(group, "actionTrigger"), "actionTriggerType", "reachPoint")
    turned = {
        "gimbalHeadingYawBase": "north", "gimbalRotateMode": "absoluteAngle",
        "gimbalPitchRotateEnable": 1, "gimbalPitchRotateAngle": _m(point.pitch_deg),
        "gimbalRollRotateEnable": 0, "gimbalRollRotateAngle": 0, "gimbalYawRotateEnable": 0, "gimbalYawRotateAngle": 0,
        "gimbalRotateTimeEnable": 0, "gimbalRotateTime": 0, "payloadPositionIndex": 0,
    }  # fmt: skip
    shot = {"fileSuffix": f"aug3d_{point.rank:03d}", "payloadPositionIndex": 0, "useGlobalPayloadLensIndex": 1}
    for number, (what, how) in enumerate((("gimbalRotate", turned), ("takePhoto", shot))):
        action = _add(group, "action")
        _add_all(action, {"actionId": number, "actionActuatorFunc": what})
        _add_all(_add(action, "actionActuatorFuncParam"), how)


def _document() -> tuple[ElementTree.Element, ElementTree.Element]:
    root = ElementTree.Element(f"{{{_KML}}}kml")
    return root, _add(root, "Document", None, _KML)


def _add(parent: ElementTree.Element, name: str, text: str | None = None, space: str = _WPML) -> ElementTree.Element:
    child = ElementTree.SubElement(parent, f"{{{space}}}{name}")
    child.text = text
    return child


def _add_all(parent: ElementTree.Element, values: Mapping[str, str | int]) -> None:
    for name, value in values.items():
        _add(parent, name, str(value))


def _m(value: float) -> str:
    return f"{value:.2f}"


def _place(point: Waypoint) -> str:
    height_m = point.up_m if math.isnan(point.alt_m) else point.alt_m
    return f"{point.lon_deg:.8f},{point.lat_deg:.8f},{height_m:.2f}"


def _text(root: ElementTree.Element) -> bytes:
    ElementTree.indent(root)
    return ElementTree.tostring(root, encoding="UTF-8", xml_declaration=True)
