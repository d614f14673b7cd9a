"""A view that was asked for, from the packed scene to pictures; by the stage and by the command."""

import json
import shutil

import numpy as np
import pandas as pd
import pytest
from PIL import Image
from typer.testing import CliRunner

from aug3d_core.dataset.files import SCENE_ZARR
from aug3d_core.dataset.writer import write
from aug3d_core.geometry.camera_models import world_from_gl
from aug3d_core.geometry.transforms import homogeneous, invert
from aug3d_core.heads.head import build
from aug3d_core.heads.saved import save
from aug3d_core.novel import stage as prediction_stage
from aug3d_core.novel.config import PredictionConfig
from aug3d_core.novel.files import PREDICTION, PREDICTION_DEPTH, PREDICTION_VIEW
from aug3d_core.photos.files import PHOTO_TABLE
from aug3d_core.run.files import FILES
from aug3d_core.store.scenes import new_version, version_paths, versions, write_metrics
from aug3d_core.store.store import Store
from flows.cli import app
from tests.engines.toy_training import HEAD
from tests.same_files import assert_same_files
from tests.toy_scene import toy_scene


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """Return the folders that the stage reads: a toy scene and a network that was not trained."""
    folder = tmp_path_factory.mktemp("made")
    for name in ("dataset", "training", "photos"):
        (folder / name).mkdir()
    scene = toy_scene(0, 24, 16)
    write(scene, folder / "dataset" / SCENE_ZARR, shard_views=64)
    save(build(HEAD), folder / "training")
    table = pd.DataFrame({"photo_id": range(36), "name": [f"day{i % 2}/{i:03}.jpg" for i in range(36)]})
    table.to_parquet(folder / "photos" / PHOTO_TABLE)
    return folder


def predicted(made, out, **asked):
    inputs = {name: made / name for name in ("dataset", "training")}
    return prediction_stage.run(inputs, PredictionConfig(**asked), out, lambda done, total, what: None)


def figure(outcome, name):
    return float(outcome.metrics[name])


def test_it_leaves_pictures_and_the_camera(made, tmp_path):
    outcome = predicted(made, tmp_path)
    with Image.open(tmp_path / PREDICTION) as picture, Image.open(tmp_path / PREDICTION_DEPTH) as depth:
        assert picture.size == depth.size == (24, 16)
    view = json.loads((tmp_path / PREDICTION_VIEW).read_text())
    assert len(view["inputs"]) == 3
    assert np.array(view["world_from_cam"]).shape == (4, 4)
    assert figure(outcome, "depth_near") < figure(outcome, "depth_far")
    assert (outcome.state, outcome.notes) == ("ok", ())


def test_it_repeats_to_the_byte(made, tmp_path):
    for name in ("one", "two"):
        (tmp_path / name).mkdir()
        predicted(made, tmp_path / name, like=9)
    assert_same_files(tmp_path / "one", tmp_path / "two")


def test_fewer_inputs_than_it_was_judged_with_are_said(made, tmp_path):
    assert predicted(made, tmp_path, inputs=(8, 14)).notes == (
        "the view is predicted from 2 inputs; the model was judged with 3",
    )


def test_a_photograph_tells_how_well_it_is_met_and_whether_that_is_a_test(made, tmp_path):
    trained, held_out = (predicted(made, tmp_path, like=photo) for photo in (8, 25))
    assert 0 < figure(trained, "psnr") < 100
    assert trained.notes == ("the model was trained with photo 8: this is no test of it",)
    assert held_out.notes == ()


def test_what_no_input_shows_degrades_the_prediction(made, tmp_path):
    outcome = predicted(made, tmp_path, inputs=(0, 1, 6), at=(-10.0, -10.0, 45.0), look_at=(-1.0, -1.0, 0.0))
    assert outcome.state == "degraded"
    assert "the rest is made up" in outcome.notes[0]


@pytest.fixture(scope="module")
def home(made, tmp_path_factory):
    """Return a store with a version of a scene named toy, whose model is the network that was not trained."""
    store = Store(tmp_path_factory.mktemp("home"))
    fields = {
        "recipe": "r", "config": {"input_views": 4}, "inputs": {}, "versions": {}, "metrics": {}, "state": "ok", "notes": (),
        "series": {}, "pictures": {}, "seconds": 1.0, "peak_mib": 1.0,
    }  # fmt: skip
    records = {}
    for name in ("photos", "dataset", "training"):
        work = store.work_dir(name, "k")
        work.mkdir(parents=True)
        shutil.copytree(made / name, work / FILES)
        records[name] = store.commit(work, name, "k", fields)
    version = new_version(store, "toy")
    write_metrics(version, {"scene": "toy", "paths": version_paths(store, version, records)})
    return store.root


def invoke(*arguments):
    return CliRunner().invoke(app, ["predict", *map(str, arguments)])


def test_the_command_writes_the_view_where_it_is_wanted(home, tmp_path):
    done = invoke("toy", "--home", home, "--inputs", "8,day0/014.jpg,013.jpg", "--out", tmp_path / "view.png", "--json")
    assert done.exit_code == 0, done.output
    told = json.loads(done.stdout)
    assert told["inputs"] == [8, 14, 13]
    assert {path.name for path in tmp_path.iterdir()} == {"view.png", "view_depth.png", "view_panel.png"}
    assert told["picture"] == str(tmp_path / "view.png")


def test_a_view_is_predicted_from_as_many_photographs_as_the_model_was_judged_with(home):
    (version,) = versions(Store(home), "toy")
    for model in ((), ("--model", "toy"), ("--model", f"toy@{version.name}")):
        assert len(json.loads(invoke("toy", "--home", home, "--json", *model).stdout)["inputs"]) == 4


def test_the_command_tells_people_what_it_did(home):
    done = invoke("toy", "--home", home, "--like", "8")
    assert done.exit_code == 0
    assert "of the ground in view" in done.output
    assert "this is no test of it" in done.output.replace("\n", " ")


def test_photographs_from_outside_are_predicted_from(home, tmp_path):
    scene = toy_scene(0, 24, 16)
    views = [8, 9, 14]
    poses = homogeneous(world_from_gl(invert(scene.world_from_cam[views, :3])))
    fx, fy, cx, cy = scene.intrinsics[0].tolist()
    frames = [{"file_path": f"{v}.png", "transform_matrix": p.tolist()} for v, p in zip(views, poses, strict=True)]
    for view in views:
        Image.fromarray(scene.images[view]).save(tmp_path / f"{view}.png")
    whole = {"w": 24, "h": 16, "fl_x": fx, "fl_y": fy, "cx": cx, "cy": cy, "frames": frames}
    (tmp_path / "transforms.json").write_text(json.dumps(whole))
    asked = ("toy", "--home", home, "--poses", tmp_path / "transforms.json", "--json")
    done = invoke(*asked, "--like", "8.png")
    assert done.exit_code == 0, done.output
    assert json.loads(done.stdout)["inputs"] == [1, 2]
    assert "'7.png' is no photograph" in invoke(*asked, "--inputs", "7.png").output


def test_groups_are_exported_for_pixelnerf(home, tmp_path):
    done = CliRunner().invoke(app, ["export", "toy", str(tmp_path / "out"), "--format", "dtu", "--home", str(home)])
    assert done.exit_code == 0, done.output
    assert "-c conf/exp/dtu.conf" in done.output
    assert (tmp_path / "out" / "aug3d" / "test_00000" / "image" / "000000.png").is_file()


def test_a_doubtful_view_leaves_with_3(home):
    done = invoke("toy", "--home", home, "--inputs", "0,1,6", "--at=-10,-10,45", "--look-at=-1,-1,0")
    assert done.exit_code == 3


def test_a_refusal_of_the_model_s_process_reaches_the_user(home):
    done = invoke("toy", "--home", home, "--at=0,0,-5", "--look-at=0,1,0")
    assert done.exit_code == 1
    assert "5 below the ground" in done.output


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (["--inputs", "8,99"], "'99' is no photograph of the scene"),
        (["--inputs", "8,8"], "names a photograph twice"),
        (["--inputs", "8,9", "--like", "009.jpg"], "--like 009.jpg is among --inputs"),
    ],
)
def test_photographs_that_cannot_be_meant(home, options, words):
    done = invoke("toy", "--home", home, *options)
    assert done.exit_code == 2
    assert words in done.output
