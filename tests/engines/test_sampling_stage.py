import numpy as np
import pandas as pd
import pytest
from PIL import Image

from aug3d_core.domes.cameras import Cameras
from aug3d_core.domes.files import CAMERAS, DOME_TABLE
from aug3d_core.domes.stage import run
from aug3d_core.geometry.ply import Mesh
from aug3d_core.geometry.transforms import look_at
from aug3d_core.geometry.views import Views
from aug3d_core.groups.files import GROUPS
from aug3d_core.run.errors import InputError
from aug3d_core.sfm.files import VIEWS
from aug3d_core.split.files import SPLIT_TABLE
from aug3d_core.surface.files import MESH
from tests.engines.little_town import config, town

WANTED = config(domes=6, width_px=96, height_px=72)


def photos() -> Views:
    """Six photos in a row that look straight down from a height of 20."""
    poses = np.stack([look_at(np.array([x, 1e-3, 20.0]), np.array([x, 0.0, 0.0])) for x in np.linspace(-20, 20, 6)])
    return Views(np.arange(6), poses, np.tile([400.0, 400.0, 256.0, 144.0], (6, 1)), np.tile([512, 288], (6, 1)))


@pytest.fixture
def sample(tmp_path):
    """Return a function that runs the stage over a mesh; `sample.out` is where its files are."""

    def of(mesh: Mesh, settings=WANTED, views: Views | None = None):
        folders = {name: tmp_path / name for name in ("sfm", "grouping", "surface", "out")}
        for folder in folders.values():
            folder.mkdir(exist_ok=True)
        (views or photos()).save(folders["sfm"] / VIEWS)
        role = ["train"] * 5 + ["target"]
        table = pd.DataFrame({"view": range(6), "photo_id": range(6), "role": role})
        table.to_parquet(folders["grouping"] / SPLIT_TABLE)
        members = np.zeros((3, 4), int)
        np.savez(folders["grouping"] / GROUPS, members=members, test_members=members[:1])
        mesh.save(folders["surface"] / MESH)
        out = folders.pop("out")
        return run(folders, settings, out, lambda done, total, what: None)

    of.out = tmp_path / "out"
    return of


@pytest.mark.parametrize("choice", ["coverage", "uniform"])
def test_the_stage_writes_what_the_renderer_reads(sample, choice):
    outcome = sample(town(), WANTED.model_copy(update={"choice": choice, "max_smeared": 1.0}))
    cameras, table = Cameras.load(sample.out / CAMERAS), pd.read_parquet(sample.out / DOME_TABLE)
    assert outcome.metrics["views_planned"] == len(cameras) == 4 * outcome.metrics["domes"] > 0
    assert table[table.views > 0].dome_id.tolist() == sorted(set(cameras.dome_id.tolist()))
    assert (table[table.views == 0].dome_id == -1).all()
    # Every camera's dome, its scale and what speaks for it, and every place without one with the reason
    assert {"x", "y", "z", "radius", "cell", "why", "tried", "rejected_empty"} <= set(table.columns)
    assert (table.why.str.len() > 0).all()
    assert table.tried.sum() == outcome.metrics["cameras_tried"]
    assert outcome.metrics["worst_view_empty_share"] <= 0.1
    assert outcome.metrics["worst_view_back_faces_share"] <= 0.02
    for picture in outcome.pictures.values():
        with Image.open(sample.out / picture) as image:
            assert np.asarray(image).std() > 5


def test_the_same_inputs_give_the_same_bytes(sample):
    sample(town())
    first = {file.name: file.read_bytes() for file in sample.out.iterdir()}
    sample(town())
    assert first == {file.name: file.read_bytes() for file in sample.out.iterdir()}


def with_strips_missing(mesh: Mesh) -> Mesh:
    east = mesh.xyz[mesh.triangles].mean(axis=1)[:, 0]
    return Mesh(mesh.xyz, mesh.rgb, mesh.triangles[np.mod(east, 4.0) < 2.6])  # two thirds of the ground are left


def test_over_a_mesh_full_of_holes_domes_make_do_with_less_and_say_so(sample):
    outcome = sample(with_strips_missing(town()), WANTED.model_copy(update={"max_smeared": 1.0}))
    assert outcome.metrics["domes"] >= 1 and outcome.metrics["min_view_covered"] < WANTED.min_view_covered
    assert outcome.state == "degraded" and "the surface is patchy" in outcome.notes[0]


def test_an_empty_mesh_is_refused(sample):
    with pytest.raises(InputError, match=r"surface/mesh\.ply has no triangles"):
        sample(Mesh(town().xyz[:0], town().rgb[:0], town().triangles[:0]))


def test_a_mesh_without_places_is_refused(sample):
    mesh = town()
    mesh.xyz[7] = np.nan
    with pytest.raises(InputError, match="1 vertices without a finite place"):
        sample(mesh)


def test_a_photo_without_a_pose_is_refused(sample):
    views = photos()
    views.cam_from_world[3, 0, 3] = np.nan
    with pytest.raises(InputError, match="no finite pose for photo 3"):
        sample(town(), views=views)


def test_where_every_camera_is_rejected_there_are_no_views_and_the_reason_is_told(sample):
    outcome = sample(
        town(), WANTED.model_copy(update={"min_clearance": 0.999, "min_elevation_deg": 5, "max_elevation_deg": 5.1})
    )
    assert (
        outcome.state == "degraded"
        and "no dome stands on any of" in outcome.notes[0]
        and "too near" in outcome.notes[0]
    )
    assert len(Cameras.load(sample.out / CAMERAS)) == 0
    assert outcome.metrics["views_planned"] == 0 < outcome.metrics["rejected_too_near"]


def test_none_are_planned_where_none_are_wanted(sample):
    outcome = sample(town(), WANTED.model_copy(update={"domes": 0}))
    assert (outcome.state, outcome.notes) == ("ok", ("no virtual views are wanted (sampling.domes is 0)",))
    assert len(Cameras.load(sample.out / CAMERAS)) == 0
    assert pd.read_parquet(sample.out / DOME_TABLE).empty
    assert outcome.metrics["views_planned"] == 0 < outcome.metrics["photos_reach_share"]


def test_a_tower_alone_has_no_domes_and_says_so(sample):
    """As an orbit around a tower leaves it: no ground, and nothing behind it in any view."""
    mesh = town(tower=60.0)
    upright = mesh.triangles[mesh.xyz[mesh.triangles][:, :, 2].max(axis=1) > 1]
    outcome = sample(Mesh(mesh.xyz, mesh.rgb, upright), WANTED)
    assert outcome.state == "degraded" and "no dome stands" in outcome.notes[0]
    assert outcome.metrics["views_planned"] == 0


def test_where_no_dome_adds_enough_there_are_no_views_and_all_is_well(sample):
    outcome = sample(town(), WANTED.model_copy(update={"min_gain": 1.0, "max_smeared": 1.0}))
    assert outcome.state == "ok" and "no virtual views are needed" in outcome.notes[0]
    assert len(Cameras.load(sample.out / CAMERAS)) == 0 and outcome.metrics["uniform_views"] > 0
