"""What drones write beside EXIF."""

from __future__ import annotations

import math
from types import SimpleNamespace

import pytest

from aug3d_core.photos.xmp import Attitude, read_attitude

DJI = (
    b'<rdf:Description drone-dji:RelativeAltitude="+39.80" drone-dji:GimbalYawDegree="-132.00"'
    b' drone-dji:GimbalPitchDegree="-89.90"/>'
)
ELEMENTS = (
    b"<drone-dji:RelativeAltitude>12</drone-dji:RelativeAltitude>"
    b"<drone-dji:GimbalYawDegree>7.5</drone-dji:GimbalYawDegree>"
)
AUTEL = b"<Camera:Pitch>-45</Camera:Pitch> <Camera:Yaw>10</Camera:Yaw> drone:RelativeAltitude='30.5'"
PIX4D = b'<rdf:Description tiff:Make="%s" Camera:Yaw="92.1" Camera:Pitch="%s"/>'


def attitude(packet: object, exif: bytes = b"") -> Attitude:
    return read_attitude(SimpleNamespace(info={"xmp": packet, "exif": exif}))  # pyright: ignore[reportArgumentType]


@pytest.mark.parametrize(
    ("packet", "yaw", "pitch", "above"),
    [(DJI, -132.0, -89.9, 39.8), (ELEMENTS, 7.5, math.nan, 12.0), (AUTEL, 10.0, -45.0, 30.5)],
)
def test_attributes_and_elements_are_read(packet: bytes, yaw: float, pitch: float, above: float) -> None:
    found = attitude(packet)
    assert (found.yaw_deg, found.above_start_m) == (yaw, above)
    assert found.pitch_deg == pitch or (math.isnan(pitch) and math.isnan(found.pitch_deg))


@pytest.mark.parametrize(
    ("written", "pitch"),
    [(b"0", -90.0), (b"2.3", -87.7), (b"-1.7", -91.7), (b"-45", -135.0), (b"45", -45.0), (b"90", 0.0), (b"180", 90.0)],
)
def test_the_pitch_of_pix4d_counts_from_straight_down(written: bytes, pitch: float) -> None:
    found = attitude(PIX4D % (b"senseFly", written))
    assert found.yaw_deg == 92.1 and found.pitch_deg == pytest.approx(pitch)


@pytest.mark.parametrize("written", [b"-90", b"-46", b"181", b"360"])
def test_a_pitch_that_no_camera_on_a_drone_has_is_unknown(written: bytes) -> None:
    assert math.isnan(attitude(PIX4D % (b"senseFly", written)).pitch_deg)


@pytest.mark.parametrize(
    ("written", "pitch"), [(b"-90", -90.0), (b"-30", -30.0), (b"-0.4", -90.4), (b"0", -90.0), (b"60", -30.0)]
)
def test_autel_is_understood_in_both_of_its_conventions(written: bytes, pitch: float) -> None:
    assert attitude(PIX4D % (b"Autel Robotics", written)).pitch_deg == pitch
    assert attitude(PIX4D % (b"Camera", written), exif=b"Exif\0\0 Autel Robotics").pitch_deg == pitch


@pytest.mark.parametrize(
    "packet",
    [
        None,
        "text",
        b"",
        b"\xff\x00" * 1000,
        DJI.replace(b"-132.00", b"north").replace(b"-89.90", b"1e9").replace(b"+39.80", b""),
        DJI.replace(b"-132.00", b"999").replace(b"-89.90", b"-999").replace(b"+39.80", b"999999"),
        b" " * 2**18 + DJI,
    ],
)
def test_what_is_missing_damaged_or_impossible_is_unknown(packet: object) -> None:
    found = attitude(packet)
    assert all(math.isnan(value) for value in (found.yaw_deg, found.pitch_deg, found.above_start_m))
