from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

from aug3d_core.factory.auto.rules import RULES, RULES_OF_HEADS, rule_of
from aug3d_core.factory.auto.settle import settle
from aug3d_core.factory.config import AUTO, LEFT_OPEN, PRESETS, left_open, overridden, scene_config, validated_config
from aug3d_core.factory.material import Elsewhere, Material
from aug3d_core.factory.stages import FROM_PHOTOS, STAGES
from aug3d_core.heads.config import names
from aug3d_core.photos.files import PHOTO_TABLE
from aug3d_core.run.errors import UsageError
from aug3d_core.run.nested import flat, value_at
from aug3d_core.run.stage import Decision, StageConfig
from aug3d_core.sfm.files import VIEWS
from aug3d_core.store.record import Record
from aug3d_core.store.store import Store
from tests.report.made_up_run import flight, flown, record


@pytest.fixture
def store(tmp_path: Path) -> Store:
    return Here(tmp_path / "home")


def folder_of(tmp_path: Path, photos: int) -> Material:
    (tmp_path / "photos").mkdir()
    for number in range(photos):
        (tmp_path / "photos" / f"{number}.jpg").touch()
    return Material(photos=tmp_path / "photos")


def made(**metrics: Any) -> dict[str, Record]:
    """Return records of a finished scene like the town, with figures changed as `stage__name`."""
    figures: dict[str, dict[str, Any]] = {
        "town": {"photos": 60},
        "sfm": {"registered": 60},
        "grouping": {"k": 15, "support_views": 11, "worth_training_on": 31},
        "surface": {"render_psnr": 33.0, "covered_share": 0.95},
        "dataset": {"groups_real": 31, "groups_rendered": 3},
    }
    for name, value in metrics.items():
        stage, _, figure = name.partition("__")
        figures.setdefault(stage, {})[figure] = value
    return {stage: record(stage, metrics=told) for stage, told in figures.items()}


class Here(Store):
    """A store whose stages' files lie in folders of their names."""

    def files_dir(self, record: Record, reads: Sequence[str] = ()) -> Path:
        return self.root / record.stage


def settled(store: Store, stage: str, *overrides: str, train: int = 31, **metrics: Any) -> Any:
    """Return a stage's settings. train: photographs worth training on."""
    metrics = {"grouping__worth_training_on": train} | metrics
    return settle(STAGES[stage], scene_config(AUTO, overrides), made(**metrics), store).config


NERF = ("training.head=pixelnerf", "dataset.width_px=96", "dataset.height_px=72")  # as its rules were measured


OF_20: dict[str, Any] = {"grouping__k": 20, "grouping__support_views": 25}  # groups in which much can be given


def test_each_setting_that_is_left_open_has_a_rule_and_is_one() -> None:
    assert {*RULES, *(field for rules in RULES_OF_HEADS.values() for field in rules)} == set(LEFT_OPEN)
    of_heads = (flat(scene_config(AUTO, [f"training.head={name}"]).model_dump()) for name in names())
    assert set(LEFT_OPEN) <= {path for values in of_heads for path in values}


@pytest.mark.parametrize("preset", [name for name in PRESETS if name != AUTO])
def test_other_presets_leave_nothing_open(preset: str, store: Store) -> None:
    config = scene_config(preset)
    for stage in FROM_PHOTOS:
        found = settle(stage, config, {}, store)
        assert found.config is getattr(config, stage.name) and not found.decisions


def test_whoever_sets_a_value_decides_it_be_it_the_presets_own(store: Store) -> None:
    assert scene_config(AUTO).training.steps == 100
    config = scene_config(AUTO, ["training.steps=100"])
    assert "training.steps" not in config.auto and "depth.max_px" in config.auto
    assert settled(store, "training", "training.steps=100").steps == 100
    again = overridden(config, ["depth.max_px=300"])
    assert set(config.auto) - set(again.auto) == {"depth.max_px"}


def test_a_value_that_a_form_changed_is_set_too() -> None:
    values = scene_config(AUTO).model_dump()
    values["training"]["steps"] += 1
    assert "steps" not in left_open(validated_config(values), "training")
    assert "rendered_share" in left_open(validated_config(values), "training")


def test_only_what_a_rule_decides_can_be_left_open() -> None:
    with pytest.raises(UsageError, match=r"nothing decides matching\.seed"):
        validated_config(scene_config("tiny").model_dump() | {"auto": ("matching.seed",)})
    with pytest.raises(UsageError, match="there is no stage 'auto'"):
        scene_config(AUTO, ["auto.steps=3"])


def test_a_head_without_rules_of_its_own_is_trained_as_its_preset_has_it() -> None:
    assert rule_of("training.steps", "pixelnerf") and not rule_of("training.steps", "another")
    assert rule_of("training.rendered_share", "another") is RULES["training.rendered_share"]


def test_a_stage_never_sees_that_something_was_open(store: Store) -> None:
    for stage in FROM_PHOTOS:
        found = settle(stage, scene_config(AUTO), made(), store)
        assert isinstance(found.config, StageConfig) and type(found.config) is stage.config
        for decision in found.decisions:
            assert value_at(found.config.model_dump(), decision.field.partition(".")[2]) == decision.value
            assert decision.measured and decision.rule


def test_pictures_are_as_fine_as_the_views_that_are_predicted(store: Store, tmp_path: Path) -> None:
    assert settled(store, "photos").max_px == 768
    assert settled(store, "photos", "dataset.width_px=400").max_px == 1200
    assert settled(store, "photos", *NERF).max_px == 576
    few = settle(STAGES["photos"], scene_config(AUTO), {}, store, folder_of(tmp_path, 12))
    assert few.config == scene_config(AUTO).photos, "few photographs keep all they have"
    assert "12 photographs" in few.decisions[0].measured
    assert settled(store, "depth").max_px == 512 and settled(store, "depth", *NERF).max_px == 288
    assert settled(store, "depth", "dataset.width_px=160").max_px == 320
    assert settled(store, "surface", "photos.max_px=240").texel_gsd == 1, "never finer than the photographs"
    assert settled(store, "surface", "photos.max_px=960").texel_gsd == 1.5
    assert settled(store, "surface", *NERF, "photos.max_px=960").texel_gsd == 4
    views = settled(store, "sampling", "dataset.width_px=160", "dataset.height_px=120")
    assert (views.width_px, views.height_px) == (160, 120)


def test_photographs_that_show_nothing_new_are_left_out_unless_there_are_few(store: Store, tmp_path: Path) -> None:
    config = scene_config(AUTO)
    for count, least in ((39, 0.0), (40, 0.05)):
        (tmp_path / str(count)).mkdir()
        found = settle(STAGES["photos"], config, {}, store, folder_of(tmp_path / str(count), count))
        assert found.config.model_dump()["least_motion"] == least


@pytest.mark.parametrize(("photos", "first_octave"), [(40, 0), (39, -1)])
def test_features_smaller_than_pixels_are_sought_in_few_photographs_only(
    photos: int, first_octave: int, store: Store, tmp_path: Path
) -> None:
    found = settle(STAGES["matching"], scene_config(AUTO), made(), store, folder_of(tmp_path, photos))
    assert found.config.model_dump()["first_octave"] == first_octave


@pytest.mark.parametrize(("k", "support", "given"), [(15, 11, 6), (6, 11, 5), (10, 2, 2)])
def test_a_view_is_swept_from_six_if_there_are_so_many(k: int, support: int, given: int, store: Store) -> None:
    figures = {"grouping__k": k, "grouping__support_views": support}
    assert settled(store, "evaluation", **figures).input_views == given
    assert settled(store, "evaluation", "evaluation.input_views=1", **figures).input_views == 1


@pytest.mark.parametrize(("k", "support", "given"), [(15, 11, 6), (6, 11, 5), (10, 2, 2)])
def test_a_view_is_predicted_from_twice_as_many_as_were_trained_with_if_there_are_so_many(
    k: int, support: int, given: int, store: Store
) -> None:
    figures = {"grouping__k": k, "grouping__support_views": support}
    assert settled(store, "evaluation", *NERF, **figures).input_views == given
    assert settled(store, "evaluation", *NERF, "training.input_views=2", **figures).input_views == min(given, 4)


def test_depth_and_texels_are_never_finer_than_the_photographs(store: Store) -> None:
    (store.root / "photos").mkdir()
    sizes = pd.DataFrame({"width_px": [200, 150], "height_px": [150, 240]})
    sizes.to_parquet(store.root / "photos" / PHOTO_TABLE)
    records = made() | {"photos": record("photos", config={"max_px": 1024})}  # of which the photographs have less
    assert settle(STAGES["depth"], scene_config(AUTO), records, store).decisions[0].value == 200
    texel = settle(STAGES["surface"], scene_config(AUTO), records, store).decisions[0]
    assert texel.value == 1 and "covers 0.7 pixels of a photograph" in texel.measured


@pytest.mark.parametrize(
    ("sizes", "texel_gsd", "pixels", "widest"),
    [
        ([(1024, 768)], 1.6, "4.0", 1024), ([(768, 1024)], 1.2, "3.0", 768), ([(1024, 576)], 1.2, "3.0", 1024),
        ([(1024, 768), (1024, 768), (4096, 3072)], 1.6, "4.0", 4096),
    ],
)  # fmt: skip
def test_photographs_are_measured_along_the_side_by_which_they_are_packed(
    sizes: list[tuple[int, int]], texel_gsd: float, pixels: str, widest: int, store: Store
) -> None:
    """The median one is, for texels; maps are as wide as the widest at most."""
    (store.root / "photos").mkdir()
    pd.DataFrame(sizes, columns=["width_px", "height_px"]).to_parquet(store.root / "photos" / PHOTO_TABLE)
    records = made() | {"photos": record("photos")}
    texel = settle(STAGES["surface"], scene_config(AUTO), records, store).decisions[0]
    assert texel.value == texel_gsd and f"covers {pixels} pixels of a photograph" in texel.measured
    large = scene_config(AUTO, ["dataset.width_px=3000"])
    assert settle(STAGES["depth"], large, records, store).decisions[0].value == widest


@pytest.mark.parametrize(
    ("overrides", "figures", "field", "wanted", "bound"),
    [
        (("training.head=pixelnerf",), {"grouping__worth_training_on": 10_000}, "training.warmup_steps", "120,000", 100_000),
        ((*NERF, "training.input_views=9"), OF_20, "evaluation.input_views", "18", 16),
        ((*NERF, "photos.max_px=5160"), {}, "surface.texel_gsd", "21.5", 20),
    ],
)  # fmt: skip
def test_no_more_is_decided_than_a_setting_may_have(
    overrides: tuple[str, ...], figures: dict[str, Any], field: str, wanted: str, bound: int, store: Store
) -> None:
    stage, _, name = field.partition(".")
    found = settle(STAGES[stage], scene_config(AUTO, overrides), made(**figures), store)
    (decision,) = (one for one in found.decisions if one.field == field)
    assert decision.value == bound == value_at(found.config.model_dump(), name)
    assert f"that would be {wanted}, and {bound:,} is the bound of the setting" in decision.rule


def test_a_decision_within_its_bounds_does_not_speak_of_them(store: Store) -> None:
    config = scene_config(AUTO, [*NERF, "training.input_views=8"])
    (decision,) = settle(STAGES["evaluation"], config, made(**OF_20), store).decisions
    assert decision.value == 16 and "bound" not in decision.rule


def test_a_decision_that_a_stage_refuses_is_told_with_its_setting(
    store: Store, monkeypatch: pytest.MonkeyPatch
) -> None:
    def wide(field: str, head: str) -> Any:
        return lambda known: Decision(field=field, value="wide", measured="a guess", rule="none")

    monkeypatch.setattr("aug3d_core.factory.auto.settle.rule_of", wide)
    for stage, field in (("depth", "depth.max_px"), ("training", "training.head.planes")):
        with pytest.raises(UsageError, match=f"{field}='wide': input should be a valid integer"):
            settle(STAGES[stage], scene_config(AUTO), made(), store)


def test_what_smaller_depth_maps_cost_is_told_where_they_are_smaller(store: Store) -> None:
    (smaller, *_), (larger, *_) = (
        settle(STAGES["depth"], scene_config(AUTO, [f"dataset.width_px={px}"]), made(), store).decisions
        for px in (96, 400)
    )
    assert "0.944" in smaller.costs and larger.value == 800 and not larger.costs


def test_samples_of_which_the_user_set_a_part_are_the_users(store: Store, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("aug3d_core.factory.auto.pixelnerf.known_parallax", lambda known: 60.0)
    samples = {name: f"training.head.{name}_samples" for name in ("coarse", "fine", "depth")}

    def decided(*overrides: str) -> dict[str, object]:
        found = settle(STAGES["training"], scene_config(AUTO, [*NERF, *overrides]), made(), store).decisions
        return {one.field: one.value for one in found if one.field in samples.values()}

    assert decided() == {samples["coarse"]: 12, samples["fine"]: 6, samples["depth"]: 3}
    assert decided("training.head.coarse_samples=32") == {}
    assert decided("training.head.fine_samples=9") == {samples["coarse"]: 12, samples["depth"]: 3}


def test_as_many_virtual_views_as_photographs_unless_the_mesh_is_bad(store: Store) -> None:
    views = settled(store, "sampling")
    assert (views.domes, views.views_per_dome) == (3, None), "of 15 views each, as groups of photographs"
    assert settled(store, "sampling", "sampling.views_per_dome=20").domes == 2
    assert settled(store, "training").rendered_share == 0.6
    poor: list[dict[str, Any]] = [{"surface__render_psnr": 15.0}, {"surface__covered_share": 0.3}]
    for bad in poor:
        assert settled(store, "sampling", **bad).domes == 0
        assert settled(store, "training", **bad).rendered_share == 0
    assert settled(store, "training", dataset__groups_rendered=0).rendered_share == 0


def test_nothing_is_rendered_for_photographs_that_overlap_in_tens(store: Store) -> None:
    plenty = {"grouping__k": 10}
    assert settled(store, "sampling", **plenty).domes == 0
    assert settled(store, "training", **plenty).rendered_share == 0
    assert settled(store, "sampling", grouping__k=6).domes == 6, "fewer than ten overlap: new directions are wanted"
    assert settled(store, "training", grouping__k=20).rendered_share == 0.6, (
        "asked for by hand: groups of 20 gain by them"
    )


def test_steps_grow_with_what_there_is_to_learn_from(store: Store) -> None:
    assert settled(store, "training").steps == 124
    assert settled(store, "training", train=62).steps == 248
    assert settled(store, "training", "training.head.crop_px=64", train=62).steps == 992
    assert settled(store, "training", train=6).steps == 100, "the rate has to rise and fall"
    assert settled(store, "sampling", train=30).domes == 2


def test_rays_are_counted_where_a_step_looks_along_rays(store: Store) -> None:
    assert settled(store, "training", *NERF).steps == 628
    assert settled(store, "training", *NERF, train=62).steps == 1256
    assert settled(store, "training", *NERF, "training.head.rays_per_group=512").steps == 314
    assert settled(store, "training", *NERF, train=6).steps == 300


def test_the_network_is_as_wide_as_there_are_pixels_to_learn_it_from(store: Store) -> None:
    widths = [settled(store, "training", *NERF, train=photos).head.hidden for photos in (3, 31, 200, 2000)]
    assert widths == sorted(widths) and (widths[0], widths[-1]) == (32, 256)
    assert settled(store, "training", *NERF, train=31).head.encoder_channels == 12
    assert settled(store, "training", *NERF, train=2000).head.encoder_channels == 96
    assert settled(store, "training", *NERF, "training.head.hidden=128").head.encoder_channels == 24, (
        "the preset's, beside a width set by hand"
    )


def test_few_steps_are_all_made(store: Store) -> None:
    few = settled(store, "training")
    assert (few.least_gain_db, few.warmup_steps) == (0, 7), "a twentieth, as the preset has it"
    many = settled(store, "training", train=600)
    assert (many.least_gain_db, many.warmup_steps) == (0.05, many.steps // 20)
    assert settled(store, "training", *NERF, "training.steps=50").least_gain_db == 0.05, "these were not decided here"


def test_planes_grow_with_the_layer_that_they_sweep(store: Store, monkeypatch: pytest.MonkeyPatch) -> None:
    """One for 1.5 px of parallax, in steps of eight."""

    def planes(parallax: float | None) -> int:
        monkeypatch.setattr("aug3d_core.factory.auto.sweep.known_parallax", lambda known: parallax)
        return settled(store, "training").head.planes

    assert [planes(px) for px in (1, 40, 53, 90, 9000, None)] == [16, 24, 32, 64, 128, 32]


def test_samples_grow_with_the_layer_that_they_search(tmp_path: Path) -> None:
    store = Here(tmp_path)
    flown(store.root)
    flight().save(store.root / "sfm" / VIEWS)

    def samples(thickness: float) -> list[int]:
        records = made(dataset__slab_thickness=thickness)
        config = settle(STAGES["training"], scene_config(AUTO, NERF), records, store).config
        return [getattr(config.head, f"{kind}_samples") for kind in ("coarse", "fine", "depth")]

    # Cameras 60 m high and 20 to 50 m apart see a point move by f B (1 / (60 - t) - 1 / 60) px, f = 96 px
    flat, low, high = samples(1.0), samples(20.0), samples(45.0)
    assert flat == [4, 2, 1] and flat < low < high and all(np.diff(values).max() < 0 for values in (low, high))


def test_what_a_scene_tells_nothing_of_stays_as_the_preset_has_it(store: Store) -> None:
    for stage in FROM_PHOTOS:
        found = settle(stage, scene_config(AUTO), {}, store)
        assert isinstance(found.config, StageConfig)
    assert settle(STAGES["training"], scene_config(AUTO), {}, store).config == scene_config(AUTO).training


def test_photographs_of_another_machine_count_as_they_were_read_there(store: Store, tmp_path: Path) -> None:
    here = folder_of(tmp_path, 45)
    there = Material(photos=tmp_path / "gone", elsewhere=Elsewhere(photos="digest", photo_count=45))
    for stage in ("photos", "matching"):
        decided = [settle(STAGES[stage], scene_config(AUTO), made(), store, material) for material in (here, there)]
        assert decided[0] == decided[1]
