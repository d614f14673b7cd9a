"""A store that does not let us in says so once and clearly, names no key, and loses nothing that was made."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path

import boto3
import pytest
from typer.testing import CliRunner

from aug3d_core.bench.s3_service import BUCKET, KEYS, s3_service
from aug3d_core.run.errors import StoreError
from aug3d_core.store.store import Store
from flows.cli import app
from tests.store.test_store import commit

READING = {
    "Version": "2012-10-17",
    "Statement": [{"Effect": "Allow", "Action": ["s3:Get*", "s3:List*"], "Resource": "*"}],
}
ALL = {"Version": "2012-10-17", "Statement": [{"Effect": "Allow", "Action": "*", "Resource": "*"}]}
REFUSED = "does not let us in"


@pytest.fixture(scope="module")
def guarded() -> Iterator[dict[str, dict[str, str]]]:
    """Return the environments of users of a service that asks for rights: one may do all, one may read, one is unknown."""
    with s3_service(free_actions=2 * 3) as address:
        iam = boto3.client(
            "iam",
            endpoint_url=address,
            region_name="us-east-1",
            aws_access_key_id=KEYS["AWS_ACCESS_KEY_ID"],
            aws_secret_access_key=KEYS["AWS_SECRET_ACCESS_KEY"],
        )
        common = {"AWS_ENDPOINT_URL": address, "AUG3D_STORE": f"s3://{BUCKET}/guarded"}
        users = {"unknown": {**KEYS, **common}}
        for name, policy in {"writer": ALL, "reader": READING}.items():
            iam.create_user(UserName=name)
            iam.put_user_policy(UserName=name, PolicyName=name, PolicyDocument=json.dumps(policy))
            key = iam.create_access_key(UserName=name)["AccessKey"]
            keys = {"AWS_ACCESS_KEY_ID": key["AccessKeyId"], "AWS_SECRET_ACCESS_KEY": key["SecretAccessKey"]}
            users[name] = {**KEYS, **keys, **common}
        yield users


def be(user: dict[str, str], monkeypatch: pytest.MonkeyPatch) -> None:
    for name, value in user.items():
        monkeypatch.setenv(name, value)


def secrets(guarded: dict[str, dict[str, str]]) -> list[str]:
    return [user[name] for user in guarded.values() for name in ("AWS_ACCESS_KEY_ID", "AWS_SECRET_ACCESS_KEY")]


def test_keys_that_the_service_does_not_know_end_each_command_with_one_error(
    guarded: dict[str, dict[str, str]],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    caplog: pytest.LogCaptureFixture,
) -> None:
    be(guarded["unknown"], monkeypatch)
    (tmp_path / "photos").mkdir()
    (tmp_path / "photos" / "a.jpg").write_bytes(b"a photograph")
    run = ["run", "x", "--photos", str(tmp_path / "photos"), "--dry-run"]
    for words in (["show", "hill"], run, ["gc", "--dry-run"], ["verify"], ["scenes", "list"]):
        done = CliRunner().invoke(app, [*words, "--home", str(tmp_path / "home"), "--json"])
        failure = json.loads(done.stdout)["failure"]
        assert done.exit_code == 1 and f"s3://{BUCKET}/guarded {REFUSED}" in failure["problem"], words
        assert "AWS_ACCESS_KEY_ID" in failure["remedy"]
        told = f"{done.output}{caplog.text}"
        assert not [secret for secret in secrets(guarded) if secret in told]


def test_who_may_only_read_reads_and_what_it_makes_waits_for_the_right(
    guarded: dict[str, dict[str, str]], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    be(guarded["writer"], monkeypatch)
    theirs = commit(Store(tmp_path / "writer"))
    be(guarded["reader"], monkeypatch)
    store = Store(tmp_path / "reader")
    assert (store.files_dir(theirs) / "sub" / "a.txt").read_text() == "hello"
    with pytest.raises(StoreError, match=REFUSED) as caught:
        commit(store, "mine", "k2")
    assert not [secret for secret in secrets(guarded) if secret in str(caught.value)]
    be(guarded["writer"], monkeypatch)
    again = Store(tmp_path / "reader")
    assert again.whole("photos", "k2") is None, "others lack it"
    made, wrong = again.take("photos", "k2")
    assert made and not wrong and Store(tmp_path / "third").find("photos", "k2") == made
