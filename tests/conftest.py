"""Fixtures that every test may use."""

import os
import zlib
from collections.abc import Iterator
from pathlib import Path

import pytest
from hypothesis import settings

# As the command line does, which would be too late: threads that share products of small matrices mostly wait for each
# other, and NumPy reads this when it is first imported.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
from mcap_landmarks.networks import cache

from tests.remote.object_store import Bucket, new_bucket, serving_s3, use_server
from tests.report import results
from tests.shared import data_folder

NANODET = cache.folder() / "nanodet.onnx"
"""Where the user's own cache has it, before the tests get one of their own."""

# The same examples on every run and machine: a red test is a change, not luck.
settings.register_profile("fixed", derandomize=True, deadline=None)
settings.load_profile("fixed")


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--update-golden", action="store_true", help="write the results in tests/golden/ anew")


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Tests on real data take minutes, so they come first: in parallel runs the others fill the time beside them."""
    items.sort(key=lambda item: "real" not in item.path.parts)


@pytest.fixture(scope="session", autouse=True)
def empty_cache(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """A cache folder of the tests' own: what they find must not hang on what their user fetched."""
    folder = tmp_path_factory.mktemp("cache")
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("MCAP_LANDMARKS_CACHE", str(folder))
        yield folder


@pytest.fixture
def cached_network(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A cache that has a network, which is none: images of others' cameras have one to look at them."""
    models = tmp_path / "cache" / "models"
    models.mkdir(parents=True)
    (models / "nanodet.onnx").touch()
    monkeypatch.setenv("MCAP_LANDMARKS_CACHE", str(models.parent))
    return models


@pytest.fixture(scope="session")
def nanodet() -> Path:
    """NanoDet-g as the user's cache has it; tests that need it are skipped where it was not fetched."""
    path = NANODET
    if not path.is_file():
        pytest.skip("NanoDet-g is not in the cache; `mcap-landmarks models get nanodet` fetches it once")
    return path


@pytest.fixture(scope="session")
def shared_data() -> Path:
    """Folder of the data that others made; tests that need it are skipped where it is missing."""
    path = data_folder()
    if path is None:
        pytest.skip("no data at ../shared/data; set MCAP_LANDMARKS_DATA to where it lies")
    return path


@pytest.fixture(scope="session")
def whole_result(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A log with images, scans and truth, and all that localize finds in it; only to be read."""
    return results.whole_result(tmp_path_factory.mktemp("whole") / "result.mcap")


@pytest.fixture(scope="session")
def s3_server() -> Iterator[str]:
    """The address of a store that speaks S3."""
    with serving_s3() as address:
        yield address


@pytest.fixture
def bucket(s3_server: str, monkeypatch: pytest.MonkeyPatch, request: pytest.FixtureRequest) -> Bucket:
    """A bucket of the test's own, and credentials for it in the environment."""
    use_server(s3_server, monkeypatch)
    return new_bucket(f"b{zlib.crc32(request.node.nodeid.encode()):08x}")
