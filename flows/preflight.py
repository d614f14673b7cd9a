"""Look before hours of work at what is used only late in it: the servers and the weights that the user named."""

from __future__ import annotations

import base64
import os
import urllib.error
import urllib.request
from collections.abc import Mapping
from urllib.parse import unquote, urlsplit, urlunsplit

from aug3d_core.domes.sam_weights import find_weights
from aug3d_core.factory.config import SceneConfig
from aug3d_core.heads.pixelnerf import named_weights as pixelnerf_weights
from aug3d_core.heads.pixelnerf.config import PixelNerfConfig
from aug3d_core.heads.sweep import named_weights as sweep_weights
from aug3d_core.heads.sweep.config import SweepConfig
from aug3d_core.run.errors import StoreError
from aug3d_core.store.scenes import masked
from tasks.ping import unreachable

_PREFECT, _MLFLOW = "PREFECT_API_URL", "MLFLOW_TRACKING_URI"
_SERVERS = {_PREFECT: "Prefect server", _MLFLOW: "MLflow server"}
# An address that answers only to those who may use the server, and where the password for it is read from.
_GUARDED = {_PREFECT: "/admin/version", _MLFLOW: "/api/2.0/mlflow/experiments/get?experiment_id=0"}
_PASSWORDS = {
    _PREFECT: "PREFECT_API_AUTH_STRING (user:password)",
    _MLFLOW: "MLFLOW_TRACKING_USERNAME and MLFLOW_TRACKING_PASSWORD",
}
_PATIENCE_S = 5.0


def check_weights(config: SceneConfig) -> None:
    """Raise InputError that names first weights of training, or what segments photographs, if they are not there."""
    head, sampling = config.training.head, config.sampling
    if isinstance(head, SweepConfig):
        sweep_weights.check_named(head)
    if isinstance(head, PixelNerfConfig):
        pixelnerf_weights.check_named(head)
    if sampling.method == "sam" and sampling.domes:
        find_weights(sampling.sam_weights)


def check_servers(environment: Mapping[str, str] = os.environ) -> None:
    """Raise StoreError that names the first server, of those in the environment, that does not let us in.

    Nor may Prefect's be out of reach; what MLflow's is not told, it is told later.
    """
    for variable, name in _SERVERS.items():
        address = environment.get(variable, "")
        if not address.startswith(("http://", "https://")):
            continue
        if why := unreachable(address):
            if variable == _MLFLOW:  # the run goes on, and MLflow is told of it afterwards
                continue
            raise StoreError(
                f"the {name} at {masked(address)} (from {variable}) cannot be reached: {why}",
                f"start it, or unset {variable} to run without a server",
            )
        if _turned_away(address + _GUARDED[variable], _authorization(variable, environment)):
            raise StoreError(
                f"the {name} at {masked(address)} does not take the password that it is given",
                f"set {_PASSWORDS[variable]} to its own; that of `aug3d up` is AUG3D_PASSWORD, or else in "
                "services/token of its home",
            )


def _turned_away(address: str, authorization: str | None) -> bool:
    parts = urlsplit(address)
    if "@" in parts.netloc:  # Python would take user:password for a part of the name
        user, _, host = parts.netloc.rpartition("@")
        address, authorization = urlunsplit(parts._replace(netloc=host)), authorization or _basic(unquote(user))
    request = urllib.request.Request(address, headers={"Authorization": authorization} if authorization else {})
    try:
        with urllib.request.urlopen(request, timeout=_PATIENCE_S):
            return False
    except urllib.error.HTTPError as error:
        return error.code in (401, 403)
    except OSError:  # other trouble is told when the server is used
        return False


def _authorization(variable: str, environment: Mapping[str, str]) -> str | None:
    token = environment.get("PREFECT_API_KEY" if variable == _PREFECT else "MLFLOW_TRACKING_TOKEN")
    if variable == _PREFECT:
        user_and_password = environment.get("PREFECT_API_AUTH_STRING")
    else:
        user = environment.get("MLFLOW_TRACKING_USERNAME")
        user_and_password = f"{user}:{environment.get('MLFLOW_TRACKING_PASSWORD', '')}" if user else None
    if user_and_password:
        return _basic(user_and_password)
    return f"Bearer {token}" if token else None


def _basic(user_and_password: str) -> str:
    return "Basic " + base64.b64encode(user_and_password.encode()).decode()
