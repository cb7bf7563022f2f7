"""ONNX files and how they are run."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
import onnxruntime
from numpy.typing import NDArray
from onnxruntime.capi import onnxruntime_pybind11_state as state

from mcap_landmarks.errors import ModelError
from mcap_landmarks.locations import Location, to_read
from mcap_landmarks.vision.config import Provider, ProviderChoice
from mcap_landmarks.vision.providers import best_provider, start

Shape = tuple[int | None, ...]

_FAILURES = (
    *(state.Fail, state.InvalidArgument, state.NoSuchFile, state.NoModel, state.RuntimeException, state.EPFail),
    *(state.InvalidProtobuf, state.NotImplemented, state.InvalidGraph, RuntimeError, ValueError),
)
_ERRORS_ONLY = 3  # onnxruntime's severity: 0 is verbose, 4 is fatal
FLOATS: Mapping[str, np.dtype[np.floating]] = {"float": np.dtype(np.float32), "float16": np.dtype(np.float16)}
"""The types of an input that takes images, by the names that ONNX gives them."""
NO_CONSTANTS: Mapping[str, NDArray[Any]] = {}


@dataclass(frozen=True, slots=True)
class Tensor:
    """An input or output as the file declares it; None stands for a free length."""

    name: str
    shape: Shape
    dtype: str

    def __str__(self) -> str:
        return f"{self.name} {written(self.shape)} {self.dtype}"


def written(shape: Sequence[int | None]) -> str:
    """A shape such as `[1, 3, ?, ?]`."""
    return "[" + ", ".join("?" if length is None else str(length) for length in shape) + "]"


def fits(found: Sequence[int | None], expected: Shape) -> bool:
    """Whether two shapes agree wherever both are known."""
    pairs = zip(found, expected, strict=False)
    return len(found) == len(expected) and all(a == b or a is None or b is None for a, b in pairs)


class OnnxSession:
    """A loaded ONNX file; made by `open_session`. It may be run from several threads."""

    def __init__(self, path: Location, session: onnxruntime.InferenceSession, provider: Provider) -> None:
        self.path, self.provider = path, provider
        self.inputs = tuple(_tensor(entry) for entry in session.get_inputs())
        self.outputs = tuple(_tensor(entry) for entry in session.get_outputs())
        self.metadata: Mapping[str, str] = session.get_modelmeta().custom_metadata_map
        self._session = session

    def run(self, array: NDArray[Any], constants: Mapping[str, NDArray[Any]] = NO_CONSTANTS) -> list[NDArray[Any]]:
        """The outputs for the first input, with `constants` for the others by name.

        Raises:
            ModelError: the model cannot take this input.
        """
        try:
            return [np.asarray(output) for output in self._session.run(None, {self.inputs[0].name: array, **constants})]
        except _FAILURES as error:
            shape = written(array.shape)
            raise ModelError(
                f"{self.path} failed on an input {shape}: {_first_line(error)}; export it again"
            ) from error


def open_session(path: Location, provider: ProviderChoice = "cpu", threads: int = 0) -> OnnxSession:
    """A session of an ONNX file, the same one for the same file and settings; `threads` 0: one per core.

    Raises:
        ModelError: the file is missing or no ONNX model.
        UsageError: the provider is not installed, or does not start.
    """
    local = to_read(path)
    try:
        status = local.stat()
    except OSError as error:
        raise ModelError(f"{path}: cannot be read ({error.strerror}); check the path of the model") from error
    return _open(
        local, (status.st_mtime_ns, status.st_size), best_provider() if provider == "auto" else provider, threads
    )


@lru_cache(maxsize=2)
def _open(path: Path, _version: tuple[int, int], provider: Provider, threads: int) -> OnnxSession:
    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = threads
    options.inter_op_num_threads = 1
    options.use_deterministic_compute = True
    # Waiting threads that spin would take the cores that decoding, writing and other runs need.
    options.add_session_config_entry("session.intra_op.allow_spinning", "0")
    options.log_severity_level = _ERRORS_ONLY
    try:
        session = start(path, options, provider)
    except _FAILURES as error:
        raise ModelError(f"{path}: not an ONNX model that can be run: {_first_line(error)}") from error
    return OnnxSession(path, session, provider)


def _tensor(entry: onnxruntime.NodeArg) -> Tensor:
    shape = tuple(length if isinstance(length, int) and length > 0 else None for length in entry.shape)
    return Tensor(entry.name, shape, entry.type.removeprefix("tensor(").removesuffix(")"))


def _first_line(error: Exception) -> str:
    return str(error).strip().partition("\n")[0]
