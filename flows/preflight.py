"""Look before hours of work whether the servers that the user named can be reached."""

from __future__ import annotations

import os
import socket
from urllib.parse import urlsplit

from aug3d_core.errors import StoreError

_SERVERS = {"PREFECT_API_URL": "Prefect server", "MLFLOW_TRACKING_URI": "MLflow server"}
_PATIENCE_S = 5.0


def check_servers() -> None:
    """Raise StoreError that names the first server, of those set in the environment, that does not answer."""
    for variable, name in _SERVERS.items():
        address = os.environ.get(variable, "")
        if not address.startswith(("http://", "https://")):
            continue
        parts = urlsplit(address)
        try:
            port = parts.port or (443 if parts.scheme == "https" else 80)
            socket.create_connection((parts.hostname or "", port), timeout=_PATIENCE_S).close()
        except (OSError, ValueError) as error:
            raise StoreError(
                f"the {name} at {address} (from {variable}) cannot be reached: {error}",
                f"start it, or unset {variable} to run without a server",
            ) from error
