"""What an evaluation leaves beside scores: the rules, the flight; and what it refuses to judge."""

import json
from dataclasses import replace

import av
import numpy as np
import pandas as pd
import pytest
from skimage.metrics import structural_similarity

from aug3d_core.dataset.files import SCENE_ZARR
from aug3d_core.dataset.new_views import only, with_views
from aug3d_core.dataset.projection import middle_ground
from aug3d_core.dataset.writer import write
from aug3d_core.geometry.masks import used_pixels
from aug3d_core.heads.head import build
from aug3d_core.heads.saved import save
from aug3d_core.judging import stage as evaluation_stage
from aug3d_core.judging.config import EvaluationConfig
from aug3d_core.judging.conventions import conventions, digest, held_out_digest
from aug3d_core.judging.files import COMPARED, CONVENTIONS, FLYTHROUGH, TEST_VIEWS, mask_of
from aug3d_core.judging.flythrough import around
from aug3d_core.judging.scores import check_test_groups, ssim
from aug3d_core.photos.files import image_name
from aug3d_core.run.errors import InputError
from tests.engines.toy_training import HEAD

JUDGE = EvaluationConfig(panels=0, flythrough_frames=5)


@pytest.fixture(scope="module")
def judged(scene, tmp_path_factory):
    folder = tmp_path_factory.mktemp("judged")
    write(scene, folder / SCENE_ZARR, shard_views=64)
    save(build(HEAD), folder)
    inputs = {"dataset": folder, "training": folder}
    return folder, evaluation_stage.run(inputs, JUDGE, folder, lambda done, total, what: None)


def test_the_flight_is_a_loop_of_pictures_in_the_report(judged):
    folder, outcome = judged
    assert list(outcome.pictures.values()) == [FLYTHROUGH]
    with av.open(folder / FLYTHROUGH) as film:
        frames = [frame.to_ndarray(format="rgb24") for frame in film.decode(video=0)]
    assert len(frames) == 5 and frames[0].shape[1] > 3 * 24


def test_no_frames_mean_no_flight(judged, tmp_path):
    config = JUDGE.model_copy(update={"flythrough_frames": 0})
    inputs = {"dataset": judged[0], "training": judged[0]}
    assert evaluation_stage.run(inputs, config, tmp_path, lambda done, total, what: None).pictures == {}
    assert not (tmp_path / FLYTHROUGH).exists()


def test_a_model_worse_than_one_colour_is_degraded(judged, tmp_path, monkeypatch):
    inputs, config = {"dataset": judged[0], "training": judged[0]}, JUDGE.model_copy(update={"flythrough_frames": 0})
    evaluate = evaluation_stage.evaluate
    for psnr, state in ((3.0, "degraded"), (60.0, "ok")):
        monkeypatch.setattr(evaluation_stage, "evaluate", lambda *given, db=psnr: evaluate(*given).assign(psnr=db))
        outcome = evaluation_stage.run(inputs, config, tmp_path, lambda done, total, what: None)
        assert outcome.state == state
        assert any("mean colour" in note for note in outcome.notes) == (state == "degraded")


def test_the_flight_goes_smoothly_around_the_test_camera_and_looks_where_it_looks(scene):
    target, *inputs = scene.groups["test"][0]
    poses = around(scene, int(target), np.array(inputs), 12)
    eyes, eye = poses[:, :3, 3], scene.world_from_cam[target, :3, 3]
    steps = np.linalg.norm(eyes - np.roll(eyes, 1, axis=0), axis=1)
    assert np.allclose(steps, steps[0])
    assert np.linalg.norm(eyes - eye, axis=1).max() < max(
        np.linalg.norm(scene.world_from_cam[inputs, :3, 3] - eye, axis=1)
    )
    flown, frames = with_views(only(scene, np.array(inputs)), poses, scene.intrinsics[target], np.arange(len(inputs)))
    spots = np.array([middle_ground(flown, int(frame)) for frame in frames])
    assert np.allclose(spots, middle_ground(scene, int(target)), atol=1e-6)


def test_the_rules_and_the_photographs_stand_with_the_result(scene, judged):
    folder, outcome = judged
    assert json.loads((folder / CONVENTIONS).read_text()) == conventions(scene)
    assert outcome.metrics["conventions"] == digest(conventions(scene))
    assert outcome.metrics["test_photos"] == held_out_digest(scene)


def test_ssim_is_what_the_library_takes_for_usual():
    a, b = np.random.default_rng(0).integers(0, 256, (2, 20, 30, 3), dtype=np.uint8)
    assert ssim(a, b) == pytest.approx(structural_similarity(a, b, data_range=255, channel_axis=-1))


@pytest.mark.parametrize(
    ("groups", "words"),
    [
        (np.zeros((0, 6), np.int32), "no test group"),
        (np.array([[30]], np.int32), "one member, its target"),
    ],
)
def test_a_test_that_cannot_be_held_is_refused(scene, groups, words):
    with pytest.raises(InputError, match=words):
        check_test_groups(replace(scene, groups=scene.groups | {"test": groups}))


def test_masks_of_test_photographs_are_told_and_shown(scene, tmp_path):
    target = int(scene.groups["test"][0, 0])
    alpha = scene.alpha.copy()
    alpha[target, 4:10, 6:20] = 0
    write(replace(scene, alpha=alpha), tmp_path / SCENE_ZARR, shard_views=64)
    save(build(HEAD), tmp_path)
    config = EvaluationConfig(panels=len(scene.groups["test"]), flythrough_frames=0)
    evaluation_stage.run({"dataset": tmp_path, "training": tmp_path}, config, tmp_path, lambda done, total, what: None)
    assert "masked" in json.loads((tmp_path / CONVENTIONS).read_text())
    photo = image_name(int(scene.photo_id[target]))
    assert [file.name for file in (tmp_path / COMPARED).glob("mask_*")] == [f"mask_{photo}"]
    np.testing.assert_array_equal(used_pixels(tmp_path / mask_of(photo)), alpha[target] > 0)
    table = pd.read_parquet(tmp_path / TEST_VIEWS)
    assert (table["masked_share"] > 0).tolist() == (table["photo_id"] == scene.photo_id[target]).tolist()
