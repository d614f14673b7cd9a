"""What a version tells of places is safe to keep and to show."""

from __future__ import annotations

import pytest

from aug3d_core.store.scenes import masked


@pytest.mark.parametrize(
    ("text", "shown"),
    [
        ("postgresql+psycopg2://me:a@b:c@db:5432/mlflow", "postgresql+psycopg2://***@db:5432/mlflow"),
        (
            "no route to https://token@there/x, nor to http://other/y",
            "no route to https://***@there/x, nor to http://other/y",
        ),
        ("sqlite:////home/me@work/mlflow.db", "sqlite:////home/me@work/mlflow.db"),
        ("mail me@there", "mail me@there"),
    ],
)
def test_users_and_passwords_of_addresses_are_masked(text: str, shown: str) -> None:
    assert masked(text) == shown
