"""A store that speaks S3, on this machine: moto's server, with a bucket of its own for each test."""

import contextlib
import logging
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import fsspec
import pytest

KEY, SECRET = "AKIAPLANTEDKEY000000", "planted/secret/of/the/bucket/00000000000"
"""Credentials that stand in the environment, and may stand nowhere else."""


@dataclass(frozen=True, slots=True)
class Bucket:
    """A bucket and what lies in it, by name."""

    name: str
    files: Any

    def url(self, name: str) -> str:
        return f"s3://{self.name}/{name}"

    def read(self, name: str) -> bytes:
        content: bytes = self.files.cat_file(f"{self.name}/{name}")
        return content

    def write(self, name: str, content: bytes) -> str:
        self.files.pipe_file(f"{self.name}/{name}", content)
        return self.url(name)

    def names(self) -> list[str]:
        return sorted(name.partition("/")[2] for name in self.files.find(self.name))

    def unfinished(self) -> list[str]:
        """Uploads in parts that were neither ended nor given up."""
        found: list[Any] = self.files.call_s3("list_multipart_uploads", Bucket=self.name).get("Uploads", [])
        return [upload["Key"] for upload in found]


@contextlib.contextmanager
def serving_s3() -> Iterator[str]:
    """The address of a server while the block runs."""
    from moto.server import ThreadedMotoServer  # noqa: PLC0415 - takes a second

    logging.getLogger("werkzeug").setLevel(logging.ERROR)
    server = ThreadedMotoServer(ip_address="127.0.0.1", port=0, verbose=False)
    server.start()
    try:
        host, port = server.get_host_and_port()
        yield f"http://{host}:{port}"
    finally:
        server.stop()


def use_server(address: str, patch: pytest.MonkeyPatch) -> None:
    """Let the environment lead to a server, in this process and those that it starts."""
    for name, value in (
        ("AWS_ENDPOINT_URL", address),
        ("AWS_ACCESS_KEY_ID", KEY),
        ("AWS_SECRET_ACCESS_KEY", SECRET),
        ("AWS_DEFAULT_REGION", "us-east-1"),
        ("AWS_EC2_METADATA_DISABLED", "true"),
    ):
        patch.setenv(name, value)


def new_bucket(name: str) -> Bucket:
    """A bucket that is made now."""
    files = fsspec.filesystem("s3", use_listings_cache=False)
    files.mkdir(name)
    return Bucket(name, files)
