"""Execution providers: what is said of one that is not there or does not start, and what `auto` is; with fakes."""

from collections.abc import Iterator, Sequence
from pathlib import Path

import onnxruntime
import pytest
from mcap_landmarks.errors import ModelError, UsageError
from mcap_landmarks.vision import providers
from mcap_landmarks.vision.config import DetectConfig, ProviderChoice
from mcap_landmarks.vision.onnx_session import open_session
from mcap_landmarks.vision.providers import best_provider, settled

from tests.vision.networks import answering
from tests.vision.test_onnx_session import NAMES, rows

Asked = Sequence[str | tuple[str, dict[str, str]]]
CUDA, TENSORRT, CPU = "CUDAExecutionProvider", "TensorrtExecutionProvider", "CPUExecutionProvider"
_Session = onnxruntime.InferenceSession


class Fake:
    """An onnxruntime whose sessions run on the CPU and say that they run on what `starts`."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch, installed: Sequence[str], starts: Sequence[str]) -> None:
        self.starts, self.asked, self.error = starts, [], ""
        monkeypatch.setattr("onnxruntime.get_available_providers", lambda: [*installed])
        monkeypatch.setattr("onnxruntime.preload_dlls", lambda: print("Failed to load libcublas.so.13: no such file"))
        monkeypatch.setattr("onnxruntime.set_default_logger_severity", lambda _: None)
        monkeypatch.setattr("onnxruntime.InferenceSession", self.session)
        self.forget()

    asked: list[Asked]

    def session(self, path: str, options: object, providers: Asked, **_: object) -> onnxruntime.InferenceSession:
        self.asked.append(providers)
        if self.error and providers != [CPU]:
            raise RuntimeError(self.error)
        made = _Session(path, options, providers=[CPU])
        names = [entry if isinstance(entry, str) else entry[0] for entry in providers]
        made.get_providers = lambda: [name for name in names if name in self.starts] or [CPU]
        return made

    @staticmethod
    def forget() -> None:
        best_provider.cache_clear()
        providers._load_libraries.cache_clear()


@pytest.fixture(autouse=True)
def _forgotten() -> Iterator[None]:
    yield
    Fake.forget()


@pytest.fixture
def model(tmp_path: Path) -> Path:
    return answering(tmp_path / "m.onnx", {"output0": rows()}, NAMES)


@pytest.mark.parametrize(("asked", "remedy"), [("cuda", r"onnxruntime-gpu\[cuda,cudnn\]'"), ("tensorrt", "tensorrt")])
def test_a_missing_provider_is_said(
    model: Path, monkeypatch: pytest.MonkeyPatch, asked: ProviderChoice, remedy: str
) -> None:
    Fake(monkeypatch, [CPU], [CPU])
    with pytest.raises(UsageError, match=rf"detect\.provider = {asked}: this onnxruntime has no .*; .*{remedy}"):
        open_session(model, asked)
    assert settled(DetectConfig(provider="auto")).provider == "cpu"


@pytest.mark.parametrize("error", ["", "CUDA failure 100: no CUDA-capable device is detected\nat a file"])
def test_a_provider_that_does_not_start_is_said(model: Path, monkeypatch: pytest.MonkeyPatch, error: str) -> None:
    """Whether onnxruntime raises an error or quietly goes on without the provider."""
    fake = Fake(monkeypatch, [CUDA, CPU], [CPU])
    fake.error = error
    with pytest.raises(UsageError, match=r"CUDAExecutionProvider does not start \(Failed to load libcublas.*; check"):
        open_session(model, "cuda")
    assert settled(DetectConfig(provider="auto")).provider == "cpu"
    model.write_bytes(b"nothing")
    with pytest.raises(ModelError, match="not an ONNX model"):  # the file is at fault where it does not run anywhere
        open_session(model, "cuda")


def test_the_reason_of_an_error_is_told(model: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    fake = Fake(monkeypatch, [CUDA, CPU], [CPU])
    fake.error = "CUDA failure 100: no CUDA-capable device is detected\nat a file"
    monkeypatch.setattr("onnxruntime.preload_dlls", lambda: None)
    with pytest.raises(UsageError, match=r"does not start \(CUDA failure 100: no CUDA-capable device is detected\);"):
        open_session(model, "cuda")


def test_auto_is_cuda_where_that_starts(model: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """TensorRT is taken by name only, and leaves to CUDA what it cannot run; engines are kept."""
    fake = Fake(monkeypatch, [TENSORRT, CUDA, CPU], [TENSORRT, CUDA, CPU])
    assert settled(DetectConfig(provider="auto")).provider == "cuda"
    assert open_session(model, "auto").provider == "cuda"
    assert open_session(model, "tensorrt").provider == "tensorrt"
    (first, kept), (second, same) = fake.asked[-1]
    assert (first, kept["trt_engine_cache_enable"]) == (TENSORRT, "1")
    assert Path(kept["trt_engine_cache_path"]).name == "tensorrt"
    assert (second, same["use_tf32"], same["cudnn_conv_algo_search"]) == (CUDA, "0", "HEURISTIC")
    assert settled(DetectConfig(provider="tensorrt")) == DetectConfig(provider="tensorrt")
