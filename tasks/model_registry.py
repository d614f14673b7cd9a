"""MLflow's model registry: a scene's models as versions of `aug3d-<scene>`; the alias `best` names the best of them,
`published` that of the version which others use.

A version's files are safetensors and JSON, as the stage training wrote them; nothing in it is pickled. `latest` needs no alias:
MLflow keeps that name for the newest version.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from mlflow.entities import Run
from mlflow.entities.model_registry import ModelVersion
from mlflow.tracking import MlflowClient

from aug3d_core.factory.plan import fold_count
from aug3d_core.heads.files import MODEL_CONFIG, MODEL_WEIGHTS
from aug3d_core.store.published import RULES
from aug3d_core.store.record import Record
from aug3d_core.store.store import Store

BEST, PUBLISHED = "best", "published"
_FOLDER = "model"
_SCORE = "test_psnr_mean"
_SCORES = (
    _SCORE,
    "test_psnr_ci_low",
    "test_psnr_ci_high",
    "test_ssim_mean",
    "over_best_cheap_db",
    "test_views",
)
_SAME = ("training", "evaluation")  # what makes two models, with their scores, one version


def register(
    client: MlflowClient, run: Run, store: Store, records: Mapping[str, Record], metrics: Mapping[str, Any]
) -> ModelVersion | None:
    """Register the model of a run that trained and tested one; of a scene in folds, the first fold's.

    The same model tested the same way is one version, however often it is run. `best` is moved to it only if its test PSNR
    is above the present best's on the same photographs by the same rules.
    """
    if "training" not in records or "evaluation" not in records:
        return None
    name = _model(metrics)
    if not client.search_registered_models(f"name = '{name}'"):
        client.create_registered_model(name, description=f"Models of the scene; aug3d predict {metrics['scene']}")
    tags = _tags(records, metrics)
    version = _registered(client, name, tags) or _add(client, name, run, store, records["training"], tags)
    best = client.get_registered_model(name).aliases.get(BEST)
    rival = None if best is None else client.get_model_version(name, str(best))
    if rival is not None and rival.version != version.version and not _comparable(version, rival):
        why = f"version {best}, the best: other test photographs or rules"
        client.set_model_version_tag(name, version.version, "not_compared_with", why)
    elif rival is None or float(version.tags[_SCORE]) > float(rival.tags[_SCORE]):
        client.set_registered_model_alias(name, BEST, version.version)
    return client.get_model_version(name, version.version)


def name_published(client: MlflowClient, metrics: Mapping[str, Any]) -> None:
    """Move `published` to the model of a version that is logged; does nothing if the version has none."""
    digests = {f"digest.{stage}": metrics["stages"].get(stage, {}).get("digest") for stage in _SAME}
    if all(digests.values()) and (version := _registered(client, _model(metrics), digests)):
        client.set_registered_model_alias(_model(metrics), PUBLISHED, version.version)


def _model(metrics: Mapping[str, Any]) -> str:
    return f"aug3d-{metrics['scene']}"


def _tags(records: Mapping[str, Record], metrics: Mapping[str, Any]) -> dict[str, str]:
    tested = records["evaluation"].metrics
    tags = {name: metrics[name] for name in ("scene", "preset", "git")}
    tags |= {
        f"digest.{stage}": records[stage].digest for stage in ("dataset", "training", "evaluation") if stage in records
    }
    tags |= {"key.training": records["training"].key, "folds": fold_count(records)}
    tags |= {name: tested[name] for name in ("head", *_SCORES, *RULES) if name in tested}
    return {name: str(value) for name, value in tags.items()}


def _registered(client: MlflowClient, name: str, tags: Mapping[str, str]) -> ModelVersion | None:
    for version in client.search_model_versions(f"name = '{name}'"):
        if all(version.tags.get(f"digest.{stage}") == tags[f"digest.{stage}"] for stage in _SAME):
            return version
    return None


def _add(
    client: MlflowClient, name: str, run: Run, store: Store, training: Record, tags: dict[str, str]
) -> ModelVersion:
    for file in (MODEL_WEIGHTS, MODEL_CONFIG):
        client.log_artifact(run.info.run_id, str(store.file(training, file)), artifact_path=_FOLDER)
    return client.create_model_version(name, f"{run.info.artifact_uri}/{_FOLDER}", run.info.run_id, tags=tags)


def _comparable(one: ModelVersion, other: ModelVersion) -> bool:
    return all(rule in one.tags and one.tags[rule] == other.tags.get(rule) for rule in RULES)
