from __future__ import annotations

from aug3d_core.sfm.decisions import matching_decisions, sfm_decisions

_PLACED = {"camera_model": "OPENCV", "focal_px": 1234.56, "up_from": "gravity"}


def test_fewer_pairs_say_what_they_save() -> None:
    tried = {"pairs_tried": 563, "pairs_possible": 1770, "pairs_by": "gps", "photos": 60, "photos_doubted_gps": 0}
    [pairs] = matching_decisions(tried)
    assert pairs.value == "563 of 1,770, by gps" and pairs.saves == "68% of the comparisons"
    [pairs] = matching_decisions(tried | {"pairs_tried": 1770, "pairs_by": "exhaustive"})
    assert not pairs.saves


def test_the_lens_is_reported_with_the_errors_that_speak_for_it() -> None:
    errors = {"heldout_px_radial_exif": 0.25, "heldout_px_opencv_exif": 0.125, "heldout_px_opencv_refined": 0.1}
    focal = {"focal_source": "exif", "focal_exif_over_refined_error": 1.25, "focal_moved_share": 0.03}
    mapper = {"mapper": "global", "mapper_reason": ""}
    found = {one.field: one for one in sfm_decisions(_PLACED | errors | focal | mapper)}
    assert found["sfm.mapper"].rule == "as set"
    assert found["sfm.camera_model"].measured == "RADIAL 0.25, OPENCV 0.125 px"
    assert found["sfm.focal"].value == "1,234.6 px, exif" and "1.25 times" in found["sfm.focal"].measured
    assert found["sfm.up"].value == "gravity"


def test_a_grown_scene_has_the_lens_that_it_had() -> None:
    grown = {"grown_from": 14, "poses_kept": 14, "poses_reason": "", "focal_source": "exif"}
    grown |= {"focal_exif_over_refined_error": None, "focal_moved_share": None}
    found = {one.field: one.measured for one in sfm_decisions(_PLACED | grown)}
    assert found["sfm.focal"] == found["sfm.camera_model"] == "as in the earlier version"


def test_given_poses_leave_lens_and_vertical() -> None:
    assert [one.field for one in sfm_decisions(_PLACED)] == ["sfm.camera_model", "sfm.up"]


def test_a_bend_that_was_taken_out_is_told_with_the_lens_that_it_freed() -> None:
    taken = {
        "doming_taken_out_pct": -1.194,
        "doming_taken_out_sigma_pct": 0.0871,
        "doming_taken_out_by": "GPS altitudes",
    }
    found = {one.field: one for one in sfm_decisions(_PLACED | taken)}
    assert "-1.19 ± 0.087 %" in found["sfm.bend"].measured and "as GPS altitudes tell" in found["sfm.bend"].measured
    assert "RADIAL" in found["sfm.camera_model"].rule
    assert "sfm.bend" not in {one.field for one in sfm_decisions(_PLACED | dict.fromkeys(taken))}


def test_control_points_are_said_to_bend_or_to_move() -> None:
    left_out = {"control_left_out_m_adjusted": 0.05, "control_left_out_m_moved": 0.41}
    for adjusted, words in ((True, "poses adjusted to control points"), (False, "the world moved as a whole")):
        *_, control = sfm_decisions(_PLACED | left_out | {"control_adjusted": adjusted})
        assert (control.field, control.value) == ("sfm.control", words) and "0.050 m" in control.measured
