"""Bytes under names at an S3-compatible service: what the shared store asks of it, no more.

A name is put as it is, or only if nothing has it yet (`If-None-Match: *`); of many who try at once one wins. A service that
does not answer is asked again for a while: work waits and goes on. The door to obstore.
"""

from __future__ import annotations

import hashlib
import logging
import os
import re
import time
from collections.abc import Callable, Mapping
from datetime import timedelta
from pathlib import Path
from typing import Any, NamedTuple, TypeVar
from urllib.parse import urlsplit

import obstore
from obstore.exceptions import (
    AlreadyExistsError,
    GenericError,
    NotSupportedError,
    PermissionDeniedError,
    UnauthenticatedError,
)
from obstore.store import S3Store

from aug3d_core.run.errors import StoreError, UsageError
from aug3d_core.store.layout import SHARED_VARIABLE as VARIABLE
from aug3d_core.store.traffic import Tally

PATIENCE_S = 600.0  # that a service may be away
_PAUSE_S = 2.0
_AWAY_AFTER = timedelta(seconds=20)  # of one request
_REGION = "us-east-1"  # what services beside Amazon's expect
_PART = 5 * 2**20  # of a large file
_PAGE = 1000  # names in an answer to a list, or in a delete
_T = TypeVar("_T")
_log = logging.getLogger(__name__)


class Entry(NamedTuple):
    """Something in a bucket.

    modified_s: when it was put, by the clock of the service, in seconds since 1970. md5: of its bytes, something else where
    the service tells none.
    """

    name: str
    size_bytes: int
    modified_s: float
    md5: str

    @classmethod
    def of(cls, told: Mapping[str, Any]) -> Entry:
        """Return what a service tells of a name."""
        return cls(told["path"], told["size"], told["last_modified"].timestamp(), (told["e_tag"] or "").strip('"'))

    def surely_holds(self, content: bytes) -> bool:
        """Say whether it is known to hold these bytes without reading it."""
        return self.md5 == hashlib.md5(content, usedforsecurity=False).hexdigest()


class Bucket:
    """A bucket, or a prefix in one. url: s3://BUCKET[/PREFIX]. Address and keys come from the usual AWS_ variables."""

    def __init__(self, url: str) -> None:
        """Name the bucket without asking for it; raises UsageError if the address is not one."""
        parts = urlsplit(url)
        if parts.scheme != "s3" or not parts.netloc or parts.username or parts.query or parts.fragment:
            raise UsageError(
                f"{VARIABLE} is not the address of a bucket: it must be s3://BUCKET/PREFIX, with keys in variables",
                f"set {VARIABLE}=s3://BUCKET/PREFIX, AWS_ACCESS_KEY_ID, AWS_SECRET_ACCESS_KEY and, for a service that is "
                "not Amazon's, AWS_ENDPOINT_URL",
            )
        self.tally = Tally()
        self.url = f"s3://{parts.netloc}/{parts.path.strip('/')}".rstrip("/")
        endpoint = os.environ.get("AWS_ENDPOINT_URL", "")
        region = os.environ.get("AWS_REGION") or os.environ.get("AWS_DEFAULT_REGION") or _REGION
        self._service = S3Store(
            parts.netloc,
            prefix=parts.path.strip("/") or None,
            region=region,
            client_options={"allow_http": endpoint.startswith("http://")},
            retry_config={"max_retries": 3, "retry_timeout": _AWAY_AFTER},
        )

    def get(self, name: str) -> bytes | None:
        """Return what a name holds, None if nothing has it."""
        try:
            content = self._ask("get", lambda: obstore.get(self._service, name).bytes().to_bytes())
        except FileNotFoundError:
            return None
        self.tally.add("get", 0, down=len(content))
        return content

    def download(self, name: str, file: Path) -> str:
        """Write what a name holds to a file and return its SHA-256; raises FileNotFoundError if nothing has the name."""

        def download() -> str:
            with file.open("wb") as opened:
                return self._read(name, opened.write)

        return self._ask("get", download)

    def digest(self, name: str, on_bytes: Callable[[int], None]) -> str:
        """Read what a name holds and return its SHA-256; raises FileNotFoundError if nothing has the name."""
        return self._ask("get", lambda: self._read(name, lambda piece: on_bytes(len(piece))))

    def _read(self, name: str, use: Callable[[bytes], object]) -> str:
        digest = hashlib.sha256()
        for piece in obstore.get(self._service, name).stream():
            digest.update(piece)
            self.tally.add("get", 0, down=len(piece))
            use(piece)
        return digest.hexdigest()

    def has(self, name: str) -> bool:
        """Say whether a name is there."""
        try:
            self._ask("head", lambda: obstore.head(self._service, name))
        except FileNotFoundError:
            return False
        return True

    def holds(self, name: str, content: bytes) -> bool:
        """Say whether a name holds just these bytes; they are downloaded only where the service tells no MD5 of them."""
        try:
            found = self._ask("head", lambda: obstore.head(self._service, name))
        except FileNotFoundError:
            return False
        return Entry.of(found).surely_holds(content) or self.get(name) == content

    def put(self, name: str, content: bytes | Path) -> None:
        """Put bytes, or a file, under a name."""
        size = content.stat().st_size if isinstance(content, Path) else len(content)
        self._ask("put", lambda: obstore.put(self._service, name, content, chunk_size=_PART))
        parts = -(-size // _PART)
        self.tally.add("put", parts + 1 if parts > 1 else 0, up=size)  # a large one: begun, its parts, ended

    def create(self, name: str, content: bytes) -> bool:
        """Put bytes under a name that nothing has yet; return whether these are there now, because of this call or of one
        before it whose answer was lost."""
        try:
            self._ask("put", lambda: obstore.put(self._service, name, content, mode="create"))
        except AlreadyExistsError:
            return self.get(name) == content
        self.tally.add("put", 0, up=len(content))
        return True

    def delete(self, names: list[str]) -> None:
        """Delete names, those too that are gone."""
        if names:
            self._ask("delete", lambda: obstore.delete(self._service, names))
            self.tally.add("delete", (len(names) - 1) // _PAGE)

    def names(self, prefix: str) -> list[str]:
        """Return all names below a prefix, sorted."""
        return [each.name for each in self.entries(prefix)]

    def entries(self, prefix: str) -> list[Entry]:
        """Return all that is below a prefix, sorted by name."""
        found = self._ask("list", lambda: [each for part in obstore.list(self._service, prefix) for each in part])
        self.tally.add("list", max(len(found) - 1, 0) // _PAGE)
        return sorted(map(Entry.of, found))

    def _ask(self, kind: str, request: Callable[[], _T]) -> _T:
        """Do a request; while the service is away, again. Raises StoreError that names the store and what it said."""
        since = None
        while True:
            self.tally.add(kind)
            try:
                return request()
            except (
                FileNotFoundError, PermissionDeniedError, UnauthenticatedError, GenericError, NotSupportedError,
            ) as error:  # fmt: skip
                if "NoSuchBucket" in str(error) or (kind == "list" and "status code: 404" in str(error)):
                    raise StoreError(
                        f"there is no bucket of the store {self.url}",
                        "make the bucket, or see AWS_ENDPOINT_URL and AUG3D_STORE",
                    ) from error
                if isinstance(error, FileNotFoundError):
                    raise
                if _refused(error):
                    raise StoreError(
                        f"the store {self.url} does not let us in: {_reason(error)}",
                        "see AWS_ACCESS_KEY_ID and AWS_SECRET_ACCESS_KEY, and that they may read and write this bucket",
                    ) from None  # what the service answers may hold the key
                since = since or time.monotonic()
                if not _away(error) or time.monotonic() - since > PATIENCE_S:
                    raise StoreError(
                        f"the store {self.url} cannot be used: {_reason(error)}",
                        "see AWS_ENDPOINT_URL and that the service runs, then run again: what is finished is kept",
                    ) from None
                if since > time.monotonic() - _PAUSE_S:
                    _log.warning("the store %s does not answer; waiting for it up to %.0f s", self.url, PATIENCE_S)
                time.sleep(_PAUSE_S)


def _refused(error: Exception) -> bool:
    """Say whether a service knows us not, or does not let us do this; of lists, the library says no more than the status."""
    denied = isinstance(error, PermissionDeniedError | UnauthenticatedError)
    return denied or re.search(r"status code: (401|403)", str(error)) is not None


def _away(error: Exception) -> bool:
    """Say whether a service may be back soon: it could not be reached, broke off, or said that it is busy."""
    return re.search(r"error sending request|error decoding|timed out|status code: (429|5\d\d)", str(error)) is not None


def _reason(error: Exception) -> str:
    """Return what the library says, without what the service answers: it may repeat the key's name."""
    return str(error).strip().partition("\n")[0].partition("<")[0].rstrip(": ")
