"""Make the secrets of docker-compose.yml, once: `python3 infra/make_secrets.py`. What is there stays as it is.

The folder is its owner's alone. The files in it are readable, because the users of the containers, who are others, read them
where they are mounted one by one.
"""

import json
import secrets
from pathlib import Path

FOLDER = Path(__file__).parents[1] / "secrets"


def main() -> None:
    """Write the files that are missing; those that belong together come from one draw."""
    FOLDER.mkdir(mode=0o700, exist_ok=True)
    FOLDER.chmod(0o700)
    postgres, access, key = (secrets.token_hex(24) for _ in range(3))
    server = f"aug3d:{postgres}@postgres:5432"
    identity = {
        "name": "aug3d",
        "credentials": [{"accessKey": access, "secretKey": key}],
        "actions": ["Admin", "Read", "Write", "List", "Tagging"],
    }
    _write({"aug3d_password": secrets.token_urlsafe(24)})
    _write(
        {
            "postgres_password": postgres,
            "prefect_database": f"postgresql+asyncpg://{server}/prefect",
            "mlflow_database": f"postgresql+psycopg2://{server}/mlflow",
        }
    )
    _write(
        {
            "s3.json": json.dumps({"identities": [identity]}),
            "s3_credentials": f"[default]\naws_access_key_id = {access}\naws_secret_access_key = {key}",
        }
    )
    [known] = json.loads((FOLDER / "s3.json").read_text())["identities"][0]["credentials"]  # an earlier draw's, maybe
    _write({"s3_access_key": known["accessKey"], "s3_secret_key": known["secretKey"]})
    print(f"the secrets are in {FOLDER}; the pages ask for the password in {FOLDER / 'aug3d_password'}")


def _write(together: dict[str, str]) -> None:
    if any((FOLDER / name).exists() for name in together):
        return
    for name, text in together.items():
        (FOLDER / name).write_text(text)
        (FOLDER / name).chmod(0o444)


if __name__ == "__main__":
    main()
