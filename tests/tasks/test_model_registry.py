"""The model registry, in a real MLflow: one version per model and test, and `best` moves for a better score alone."""

from __future__ import annotations

from pathlib import Path

import pytest
from mlflow.tracking import MlflowClient

from aug3d_core.heads.files import MODEL_CONFIG, MODEL_WEIGHTS
from aug3d_core.store.store import Store
from tests.tasks.logged import version


def run(home: Path, model: str, psnr: float, photos: str = "p", rules: str = "c", scene: str = "town") -> Path:
    """Log a run whose model has a name for its bytes, and a score on some photographs by some rules."""
    from tasks.tracking import log_run

    folder = version(home, model, psnr, photos, rules, scene)
    assert log_run.fn(home, folder).waiting == ""
    return folder


def best(client: MlflowClient, scene: str = "town") -> int:
    return int(client.get_model_version_by_alias(f"aug3d-{scene}", "best").version)


def test_a_model_is_registered_with_its_score_and_what_made_it(tmp_path: Path, client: MlflowClient) -> None:
    run(tmp_path, "a", 21.5)
    found = client.get_model_version_by_alias("aug3d-town", "best")
    assert found.tags["test_psnr_mean"] == "21.5"
    assert (found.tags["key.training"], found.tags["preset"], found.tags["folds"]) == ("a", "tiny", "1")
    files = Path((found.source or "").removeprefix("file://"))
    assert {path.name for path in files.iterdir()} == {MODEL_WEIGHTS, MODEL_CONFIG}
    assert (files / MODEL_WEIGHTS).read_text() == "a"
    assert client.get_run(found.run_id or "").data.metrics["nvs.test_psnr_mean"] == 21.5


def test_the_same_model_and_test_is_one_version(tmp_path: Path, client: MlflowClient) -> None:
    for _ in range(2):
        run(tmp_path, "a", 21.5)
    assert len(client.search_model_versions("name = 'aug3d-town'")) == 1


def test_best_moves_only_to_a_better_one(tmp_path: Path, client: MlflowClient) -> None:
    seen = []
    for model, psnr in (("a", 21.0), ("b", 20.0), ("c", 22.0), ("d", 22.0)):
        run(tmp_path, model, psnr)
        seen.append(best(client))
    assert seen == [1, 1, 3, 3]
    assert len(client.search_model_versions("name = 'aug3d-town'")) == 4


@pytest.mark.parametrize("other", [{"photos": "q"}, {"rules": "e"}])
def test_scores_on_other_photographs_or_by_other_rules_are_not_compared(
    other: dict[str, str], tmp_path: Path, client: MlflowClient
) -> None:
    run(tmp_path, "a", 21.0)
    run(tmp_path, "b", 30.0, **other)
    assert best(client) == 1
    assert "version 1" in client.get_model_version("aug3d-town", "2").tags["not_compared_with"]


def test_published_is_the_model_of_the_version_that_was_named_last(tmp_path: Path, client: MlflowClient) -> None:
    from tasks.tracking import publish_model

    versions = [run(tmp_path, model, psnr) for model, psnr in (("a", 21.0), ("b", 20.0))]
    for number, one in ((1, versions[0]), (2, versions[1]), (1, versions[0])):
        assert publish_model(Store(tmp_path), "town", one.name).run_id
        assert int(client.get_model_version_by_alias("aug3d-town", "published").version) == number
    assert best(client) == 1


def test_scenes_have_models_of_their_own(tmp_path: Path, client: MlflowClient) -> None:
    run(tmp_path, "a", 21.0)
    run(tmp_path, "a", 20.0, scene="lake")
    assert best(client) == best(client, "lake") == 1
