import math
from filecmp import cmp

import pandas as pd
import pytest
import torch
from safetensors.torch import load_file

from aug3d_core.dataset.files import SCENE_ZARR
from aug3d_core.dataset.on_disk import Cache
from aug3d_core.dataset.reader import read
from aug3d_core.dataset.writer import write
from aug3d_core.heads.files import MODEL_CONFIG, MODEL_WEIGHTS
from aug3d_core.heads.sweep.config import SweepConfig
from aug3d_core.run.errors import InputError
from aug3d_core.training import divergence
from aug3d_core.training import loop as training
from aug3d_core.training import stage as training_stage
from aug3d_core.training.checkpoint import STATE, load_state, save_state, saved_steps
from aug3d_core.training.files import CHECKPOINT, CURVE
from aug3d_core.training.loop import train
from aug3d_core.training.state import begin, begin_again
from tests.engines.toy_training import CONFIG, changed, silent
from tests.toy_scene import toy_scene

LIGHT = changed(
    steps=1000, least_gain_db=0.0, hidden=8, coarse_samples=3, fine_samples=1, depth_samples=0, rays_per_group=16
)


def same_files(one, other, *names):
    return all(cmp(one / name, other / name, shallow=False) for name in names)


# What training leaves


def test_training_reports_its_curve_and_leaves_a_model(trained):
    out, outcome = trained
    assert outcome.state == "ok"
    assert outcome.notes == ()
    assert outcome.metrics["steps"] == 12
    assert outcome.metrics["stopped_by"] == "steps"
    assert outcome.metrics["restarts"] == 0
    assert 0 < outcome.metrics["loader_wait_share"] < 0.5
    assert outcome.metrics["parameters"] == sum(w.numel() for w in load_file(out / MODEL_WEIGHTS).values())
    assert [step for step, _ in outcome.series["train_psnr"]] == list(range(1, 13))
    assert len(pd.read_parquet(out / CURVE)) == 12
    assert not (out / CHECKPOINT).exists()


def test_no_steps_leave_the_first_weights_as_they_are(dataset, tmp_path):
    outcome = training_stage.run({"dataset": dataset}, changed(CONFIG, steps=0), tmp_path, silent)
    assert (outcome.state, outcome.metrics["steps"], outcome.series) == ("ok", 0, {})
    assert "train_psnr" not in outcome.metrics
    assert len(pd.read_parquet(tmp_path / CURVE)) == 0
    first = begin(changed(CONFIG, steps=0), torch.device("cpu")).head.state_dict()
    left = load_file(tmp_path / MODEL_WEIGHTS)
    assert left
    assert all(torch.equal(left[name], first[name]) for name in left)
    decided = outcome.decisions[0]
    assert (decided.field, decided.value, decided.rule) == (
        "training.steps_made",
        0,
        "the first weights are used as they are",
    )


def test_training_repeats_to_the_bit(dataset, trained, tmp_path):
    training_stage.run({"dataset": dataset}, CONFIG, tmp_path, silent)
    assert same_files(tmp_path, trained[0], MODEL_WEIGHTS, MODEL_CONFIG, CURVE)


def test_another_seed_is_another_model(dataset, trained, tmp_path):
    training_stage.run({"dataset": dataset}, changed(CONFIG, seed=1, steps=2), tmp_path, silent)
    assert not same_files(tmp_path, trained[0], MODEL_WEIGHTS)


def test_a_model_that_learned_nothing_is_degraded(dataset, tmp_path):
    config = changed(CONFIG, blend_inputs=False, steps=2, learning_rate=1e-9)
    outcome = training_stage.run({"dataset": dataset}, config, tmp_path, silent)
    assert outcome.state == "degraded"
    assert "no better than one colour" in outcome.notes[0]


# Checkpoints


def killed_at(step, scene, config, checkpoints):
    def stop(run):
        if run.step == step:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        train([scene], config, checkpoints, stop)


def test_a_killed_training_resumes_to_the_same_curve_and_weights(scene, dataset, trained, tmp_path):
    killed_at(8, scene, CONFIG, tmp_path / CHECKPOINT)
    assert saved_steps(tmp_path / CHECKPOINT) == [5]
    training_stage.run({"dataset": dataset}, CONFIG, tmp_path, silent)
    assert same_files(tmp_path, trained[0], MODEL_WEIGHTS, CURVE)


def test_the_mean_with_the_first_weights_is_taken_once_after_a_kill_too(scene, tmp_path):
    config = changed(CONFIG, steps=4, warmup_steps=1, checkpoint_every=2, head=SweepConfig(planes=8, crop_px=32))
    trained = train([scene], changed(config, start_share=0.0), tmp_path / "trained").head.state_dict()
    first = begin(config, torch.device("cpu")).head
    first.start()
    killed_at(3, scene, config, tmp_path / "killed")
    for name, value in train([scene], config, tmp_path / "killed").head.state_dict().items():
        torch.testing.assert_close(value, (first.state_dict()[name] + trained[name]) / 2)


@pytest.mark.parametrize("torn", [(10,), (5, 10)])
def test_a_torn_checkpoint_costs_the_steps_since_the_one_before(scene, dataset, trained, tmp_path, torn, capsys):
    folder = tmp_path / CHECKPOINT
    killed_at(12, scene, CONFIG, folder)
    assert saved_steps(folder) == [5, 10]
    for step in torn:
        (folder / STATE.format(step)).write_bytes(b"")  # as a power cut leaves a file that was not synced
    training_stage.run({"dataset": dataset}, CONFIG, tmp_path, silent)
    assert same_files(tmp_path, trained[0], MODEL_WEIGHTS, CURVE)
    assert capsys.readouterr().out.count("is damaged") == len(torn)


@pytest.mark.parametrize("size", [0, 200, -50])
def test_a_corrupt_checkpoint_is_refused(tmp_path, size):
    save_state(tmp_path, 5, {"history": [1.0] * 100, "weights": torch.rand(100)})
    path = tmp_path / STATE.format(5)
    path.write_bytes(path.read_bytes()[:size])
    with pytest.raises(InputError, match=r"checkpoint state-00000005\.pt is damaged"):
        load_state(tmp_path, 5)


def test_one_changed_bit_anywhere_in_a_checkpoint_is_seen(tmp_path):
    save_state(tmp_path, 5, {"history": [1.0] * 10, "weights": torch.rand(20)})
    path = tmp_path / STATE.format(5)
    whole = path.read_bytes()
    assert torch.equal(load_state(tmp_path, 5)["weights"], load_state(tmp_path, 5)["weights"])
    for bit in range(0, 8 * len(whole), 101):
        content = bytearray(whole)
        content[bit // 8] ^= 1 << (bit % 8)
        path.write_bytes(content)
        with pytest.raises(InputError, match=r"checkpoint state-00000005\.pt is damaged"):
            load_state(tmp_path, 5)


class Bomb:
    """What a hostile checkpoint could hold: code that runs when it is unpickled."""

    def __reduce__(self):
        return print, ("boom",)


def test_a_checkpoint_with_code_is_refused_without_running_it(tmp_path, capsys):
    save_state(tmp_path, 5, {"history": Bomb()})
    with pytest.raises(InputError, match=r"checkpoint state-00000005\.pt is damaged"):
        load_state(tmp_path, 5)
    assert "boom" not in capsys.readouterr().out


def test_a_checkpoint_of_another_configuration_is_refused(scene, tmp_path):
    save_state(tmp_path, 5, {"config": changed(CONFIG, hidden=32).model_dump(mode="json")})
    with pytest.raises(InputError, match="another configuration"):
        train([scene], CONFIG, tmp_path)


def test_old_states_are_thinned_out(tmp_path):
    for step in range(50, 1501, 50):
        save_state(tmp_path, step, {})
    assert saved_steps(tmp_path) == [800, 1000, 1200, 1400, 1500]


# Trouble


def poisoned_at(step, spoil):
    """Return a report that spoils the model once."""

    def report(run):
        if run.step == step and not run.restarts:
            with torch.no_grad():
                spoil(run.head)

    return report


def put_nan(model):
    model.fine.leave.weight[0, 0] = math.nan


def put_out_the_light(model):
    model.fine.leave.bias[3] = -100.0


def test_weights_gone_to_nan_are_left_behind(scene, dataset, tmp_path):
    config = changed(LIGHT, steps=90, checkpoint_every=10)
    run = train([scene], config, tmp_path, poisoned_at(75, put_nan))
    restart = run.restarts[0]
    assert restart.trouble.seen_at == 76
    assert restart.trouble.what == "the loss is nan"
    assert restart.again_from == 10  # the first of the window: later ones may already have been ill
    assert run.step == 90
    assert all(torch.isfinite(p).all() for p in run.head.parameters())
    assert run.optimiser.param_groups[0]["lr"] == pytest.approx(training.rate(config, 89, None, 1))


def test_a_field_whose_density_died_is_left_behind(scene, tmp_path, monkeypatch):
    monkeypatch.setattr(divergence, "WINDOW", 40)  # its true length is tested without a network
    run = train([scene], changed(LIGHT, steps=120), tmp_path, poisoned_at(55, put_out_the_light))
    assert run.restarts[0].trouble == (55, 95, "no light is stopped on any ray")
    assert run.restarts[0].again_from == 5
    assert run.history[-1]["light"] > 0.01


def test_a_training_that_always_ends_in_nan_is_refused_after_three_restarts(scene, tmp_path):
    def poison(run):
        with torch.no_grad():
            put_nan(run.head)

    with pytest.raises(InputError, match=r"the loss is nan at step 2, after 3 restarts .* down at 0\.00011") as caught:
        train([scene], LIGHT, tmp_path, poison)
    assert "lower learning_rate" in caught.value.remedy


def test_a_restart_is_told(dataset, scene, tmp_path, monkeypatch):
    config = changed(LIGHT, steps=30)
    poison = poisoned_at(15, put_nan)
    monkeypatch.setattr(
        training_stage,
        "train",
        lambda scenes, config, folder, report, team: train(scenes, config, folder, poison, team),
    )
    outcome = training_stage.run({"dataset": dataset}, config, tmp_path, silent)
    assert outcome.metrics["restarts"] == 1
    assert outcome.state == "ok"
    assert outcome.notes == (
        "at step 16 the loss is nan: training went back to step 0 and on at a learning rate of 0.001",
    )


def test_a_healthy_training_is_left_alone(scene, tmp_path):
    run = train([scene], changed(LIGHT, steps=450), tmp_path)
    assert run.restarts == []
    assert run.step == 450


def test_a_killed_training_resumes_after_a_restart_and_in_the_tail(scene, tmp_path):
    """All that decisions rest on is in the checkpoint: the restart, the probes, the plateau."""
    config = changed(LIGHT, steps=240, checkpoint_every=20, least_gain_db=10.0)
    whole = train([scene], config, tmp_path / "whole", poisoned_at(75, put_nan))
    assert whole.restarts
    assert whole.step < 240

    def stop(run):
        poisoned_at(75, put_nan)(run)
        if run.restarts and run.step == whole.step - 5:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        train([scene], config, tmp_path / "killed", stop)
    again = train([scene], config, tmp_path / "killed")
    assert again.history == whole.history
    assert again.probes == whole.probes
    assert again.tail_from == whole.tail_from
    for one, other in zip(again.head.parameters(), whole.head.parameters(), strict=True):
        assert torch.equal(one, other)


# Fields of the configuration


def test_only_what_is_trained_goes_to_the_optimiser(scene, tmp_path):
    config = changed(CONFIG, encoder_frozen=True, steps=3)
    run = train([scene], config, tmp_path)
    fresh = begin(config, torch.device("cpu"))
    for (name, one), other in zip(run.head.named_parameters(), fresh.head.parameters(), strict=True):
        if name.startswith("encoder."):
            assert torch.equal(one, other)


@pytest.mark.parametrize("norm", [0.0, 1e-3])
def test_gradients_are_clipped_where_a_norm_is_set(scene, tmp_path, norm):
    run = train([scene], changed(CONFIG, max_gradient_norm=norm, steps=1), tmp_path)
    left = math.sqrt(sum(float((p.grad**2).sum()) for p in run.head.parameters() if p.grad is not None))
    assert left == pytest.approx(norm or run.history[0]["gradient"], rel=1e-3)


@pytest.mark.parametrize("frozen", [False, True])
def test_a_new_attempt_has_other_weights_but_keeps_a_frozen_encoder(frozen):
    run = begin(changed(CONFIG, encoder_frozen=frozen), torch.device("cpu"))
    before = {name: value.clone() for name, value in run.head.state_dict().items()}
    begin_again(run)
    same = {name for name, value in run.head.state_dict().items() if torch.equal(value, before[name])}
    assert "fine.enter.weight" not in same
    assert ("encoder.at_half.0.weight" in same) is frozen


def test_the_encoder_starts_from_the_weights_that_are_named(scene, tmp_path):
    config = changed(CONFIG, encoder="resnet34", encoder_weights=str(tmp_path / "none.pth"))
    with pytest.raises(InputError, match=r"none\.pth is no file"):
        train([scene], config, tmp_path)


# Many scenes, from disk


def many(folder, count=3):
    inputs = {}
    for number in range(count):
        place = folder / f"scene{number}"
        place.mkdir()
        write(toy_scene(number, 24, 16), place / SCENE_ZARR, shard_views=16)
        inputs[f"s{number}"] = place
    return inputs


def test_scenes_on_disk_are_trained_on_as_those_in_memory(tmp_path):
    """To the bit, in a cache of a few pictures: what was read ahead or let go changes nothing."""
    inputs = many(tmp_path)
    stores = [read(inputs[name] / SCENE_ZARR) for name in sorted(inputs)]
    config = changed(steps=8)
    inside = train(stores, config, tmp_path / "inside")
    small = Cache(6 * 24 * 16 * 3)
    outside = train([read(inputs[name] / SCENE_ZARR, small) for name in sorted(inputs)], config, tmp_path / "outside")
    assert [step["loss"] for step in inside.history] == [step["loss"] for step in outside.history]
    assert small.held_bytes <= small.limit_bytes
    for one, other in zip(inside.head.state_dict().values(), outside.head.state_dict().values(), strict=True):
        assert torch.equal(one, other)


def test_many_scenes_are_one_training_and_its_order_is_that_of_their_names(tmp_path):
    inputs = many(tmp_path)
    (tmp_path / "a").mkdir()
    (tmp_path / "b").mkdir()
    outcome = training_stage.run(inputs, changed(steps=6), tmp_path / "a", silent)
    training_stage.run(dict(reversed(inputs.items())), changed(steps=6), tmp_path / "b", silent)
    assert outcome.metrics["scenes"] == 3
    assert same_files(tmp_path / "a", tmp_path / "b", MODEL_WEIGHTS, CURVE)


def test_a_damaged_scene_of_many_is_named(tmp_path):
    inputs = many(tmp_path)
    shard = next(file for file in (inputs["s1"] / SCENE_ZARR / "images" / "c").rglob("*") if file.is_file())
    shard.write_bytes(shard.read_bytes()[:-100] + bytes(100))
    with pytest.raises(InputError, match=r"s1: array images .* \(a chunk is missing or damaged\)|s1: array images"):
        training_stage.run(inputs, changed(steps=2), tmp_path, silent)
