"""What runs networks: onnxruntime's execution providers, and which of them `auto` is on this machine."""

import contextlib
import dataclasses
import io
from collections.abc import Mapping
from functools import cache
from pathlib import Path

import onnxruntime
import platformdirs

from mcap_landmarks.errors import UsageError
from mcap_landmarks.resources import detector
from mcap_landmarks.vision.config import DetectConfig, Provider

_NAMES: Mapping[Provider, str] = {
    "cpu": "CPUExecutionProvider",
    "cuda": "CUDAExecutionProvider",
    "tensorrt": "TensorrtExecutionProvider",
}
_REMEDIES: Mapping[Provider, str] = {
    "cpu": "install onnxruntime",
    "cuda": "pip uninstall onnxruntime, then pip install 'onnxruntime-gpu[cuda,cudnn]'",
    "tensorrt": "pip uninstall onnxruntime, then pip install 'onnxruntime-gpu[cuda,cudnn]' tensorrt",
}
_SAME_EVERY_TIME = {"cudnn_conv_algo_search": "HEURISTIC", "use_tf32": "0"}
"""Of CUDA: its default tries out which algorithm is quickest, another one each time, and TF32 has scores of three
digits (onnxruntime's documentation of the CUDA execution provider)."""

_FATAL = 4  # onnxruntime's severity


def start(path: Path, options: onnxruntime.SessionOptions, provider: Provider) -> onnxruntime.InferenceSession:
    """A session of a file that a provider runs; what fails in the file is raised as onnxruntime does.

    Raises:
        UsageError: the provider is not installed, or does not start.
    """
    name = _NAMES[provider]
    if name not in onnxruntime.get_available_providers():
        told = f"detect.provider = {provider}: this onnxruntime has no {name}"
        raise UsageError(f"{told}; {_REMEDIES[provider]}, or take auto or cpu")
    if provider == "cpu":
        return onnxruntime.InferenceSession(str(path), options, providers=[name])
    missing = _load_libraries()
    try:
        session = onnxruntime.InferenceSession(str(path), options, providers=_on_a_gpu(provider), enable_fallback=0)
    except Exception as error:
        start(path, options, "cpu")  # a file that does not run there either is what is wrong
        raise UsageError(_does_not_start(provider, missing or str(error).strip().partition("\n")[0])) from error
    if session.get_providers()[0] != name:  # onnxruntime goes on without it when a library is missing
        raise UsageError(_does_not_start(provider, missing))
    return session


def _does_not_start(provider: Provider, reason: str) -> str:
    why = f" ({reason})" if reason else ""
    told = f"detect.provider = {provider}: {_NAMES[provider]} does not start{why}"
    return f"{told}; check the driver, CUDA and cuDNN, or take auto or cpu"


def _on_a_gpu(provider: Provider) -> list[tuple[str, Mapping[str, str]]]:
    """A provider with its options, and what runs the parts of a network that it cannot."""
    cuda = (_NAMES["cuda"], _SAME_EVERY_TIME)
    if provider == "cuda":
        return [cuda]
    engines = platformdirs.user_cache_path("mcap-landmarks", appauthor=False) / "tensorrt"
    kept = {"trt_engine_cache_enable": "1", "trt_engine_cache_path": str(engines)}
    return [(_NAMES["tensorrt"], kept), cuda]


@cache
def _load_libraries() -> str:
    """Load what NVIDIA's packages hold, as onnxruntime then finds it; the first that is missing, in its words.

    It would print that among the results of a verb, and log it at length.
    """
    onnxruntime.set_default_logger_severity(_FATAL)
    with contextlib.redirect_stdout(io.StringIO()) as said:
        onnxruntime.preload_dlls()
    return said.getvalue().partition("\n")[0].strip()


@cache
def best_provider() -> Provider:
    """CUDA where it is installed and starts, else the CPU.

    TensorRT is taken by name only: it builds an engine for each network and size of image, which takes minutes.

    Raises:
        ToolkitError: this installation lacks the network that it is tried with.
    """
    if _NAMES["cuda"] in onnxruntime.get_available_providers():
        with contextlib.suppress(UsageError):
            start(detector(), onnxruntime.SessionOptions(), "cuda")
            return "cuda"
    return "cpu"


def settled(config: DetectConfig) -> DetectConfig:
    """A configuration whose provider is one that runs here, in place of `auto`."""
    return dataclasses.replace(config, provider=best_provider()) if config.provider == "auto" else config
