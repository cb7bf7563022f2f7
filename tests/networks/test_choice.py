"""Which network runs."""

from pathlib import Path

import pytest
from mcap_landmarks.errors import UsageError
from mcap_landmarks.locations import Url
from mcap_landmarks.networks.choice import choose_network
from mcap_landmarks.networks.listing import listed
from mcap_landmarks.resources import detector
from mcap_landmarks.stage import Chosen


def test_the_generators_logs_get_the_bundled_one(cached_network: Path) -> None:
    assert choose_network(None, generated=True) == Chosen(detector(), "bundled")
    assert cached_network.is_dir()


def test_other_logs_get_the_one_in_the_cache(cached_network: Path) -> None:
    assert choose_network(None, generated=False) == Chosen(cached_network / "nanodet.onnx", "nanodet")


def test_what_is_named_wins(cached_network: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(cached_network)
    (cached_network / "mine").touch()
    for generated in (False, True):
        assert choose_network(Path("bundled"), generated) == Chosen(detector(), "bundled")
        assert choose_network(Path("nanodet"), generated) == Chosen(cached_network / "nanodet.onnx", "nanodet")
        for file in (
            Path("x.onnx"),
            cached_network / "bundled",
            Path("models/nanodet"),
            Path("mine"),
            Url("s3://b/nanodet"),
        ):
            assert choose_network(file, generated) == Chosen(file, "file")


def test_several_in_the_cache_have_to_be_told_apart(cached_network: Path) -> None:
    (cached_network / "yard.onnx").touch()
    with pytest.raises(UsageError, match="the cache has the networks nanodet, yard; choose one with --model NAME"):
        choose_network(None, generated=False)
    assert choose_network(Path("yard"), generated=False) == Chosen(cached_network / "yard.onnx", "yard")
    assert [(one.name, one.state) for one in listed()] == [
        ("bundled", "bundled"),
        ("nanodet", "fetched"),
        ("yard", "cached"),
    ]


def test_where_none_fits_the_error_names_both_ways_to_a_real_one() -> None:
    with pytest.raises(UsageError) as error:
        choose_network(None, generated=False)
    for said in (
        "the bundled network knows rendered objects only (on 40 photographs it found 0 of 33 people, and 121 bicycles",
        "`mcap-landmarks models get nanodet`",
        "--model FILE.onnx",
        "--model bundled",
    ):
        assert said in str(error.value)


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("nanodet", "it is not in the cache yet; run `mcap-landmarks models get nanodet` once"),
        ("yolov5n", "neither a file nor a network here; there are bundled, nanodet, or give FILE.onnx"),
    ],
)
def test_a_name_that_is_not_there(name: str, said: str) -> None:
    with pytest.raises(UsageError) as error:
        choose_network(Path(name), generated=True)
    assert str(error.value) == f"--model {name}: {said}"
