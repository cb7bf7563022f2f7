"""Small TensorFlow.js graphs, and a slow evaluation of their operations that shares nothing with the program."""

import base64
import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float32] | NDArray[np.int32]
Attributes = Mapping[str, object]


@dataclass(slots=True)
class Built:
    """A graph under construction, with one input `x`."""

    shape: tuple[int, ...]
    nodes: list[dict[str, object]] = field(default_factory=list)
    weights: dict[str, Array] = field(default_factory=dict)
    half: bool = False

    def __post_init__(self) -> None:
        self.nodes.append({"name": "x", "op": "Placeholder"})

    def constant(self, name: str, array: Array) -> str:
        """A weight."""
        self.nodes.append({"name": name, "op": "Const"})
        self.weights[name] = array
        return name

    def node(self, name: str, op: str, inputs: Sequence[str], attributes: Attributes | None = None) -> str:
        """A node; attributes as Python has them."""
        written = {key: _written(value) for key, value in (attributes or {}).items()}
        self.nodes.append({"name": name, "op": op, "input": [*inputs], "attr": written})
        return name

    def files(self, outputs: Mapping[str, Sequence[int]]) -> tuple[bytes, bytes]:
        """The JSON and the weights."""
        manifest, content = [], b""
        for name, array in self.weights.items():
            entry: dict[str, object] = {"name": name, "shape": array.shape, "dtype": array.dtype.name}
            if self.half and array.dtype == np.float32:
                entry["quantization"] = {"dtype": "float16", "original_dtype": "float32"}
                content += array.astype("<f2").tobytes()
            else:
                content += array.tobytes()
            manifest.append(entry)
        document = {
            "format": "graph-model",
            "modelTopology": {"node": self.nodes},
            "weightsManifest": [{"paths": ["x.bin"], "weights": manifest}],
            "signature": {
                "inputs": {"x:0": _tensor(self.shape)},
                "outputs": {f"{name}:0": _tensor(shape) for name, shape in outputs.items()},
            },
        }
        return json.dumps(document).encode(), content


def _tensor(shape: Sequence[int]) -> dict[str, object]:
    return {"dtype": "DT_FLOAT", "tensorShape": {"dim": [{"size": str(length)} for length in shape]}}


def _written(value: object) -> dict[str, object]:
    match value:
        case bool():
            return {"b": value}
        case int():
            return {"i": str(value)}
        case float():
            return {"f": value}
        case str():
            return {"s": _encoded(value)}
        case [str(), *_]:
            return {"list": {"s": [_encoded(str(word)) for word in value]}}
        case list():
            return {"list": {"i": [str(number) for number in value]}}
    raise TypeError(value)


def _encoded(word: str) -> str:
    return base64.b64encode(word.encode()).decode()


def same(length: int, kernel: int, stride: int, dilation: int = 1) -> tuple[int, int, int]:
    """TensorFlow's SAME: how many results there are, and the zeros before and behind."""
    count = math.ceil(length / stride)
    zeros = max((count - 1) * stride + (kernel - 1) * dilation + 1 - length, 0)
    return count, zeros // 2, zeros - zeros // 2


def window_sums(
    x: NDArray[np.float32], filters: NDArray[np.float32], stride: int, padding: str, dilation: int = 1
) -> NDArray[np.float32]:
    """Convolution of images (n, h, w, c) with filters (kh, kw, c, m), one channel each: (n, h', w', c, m)."""
    kh, kw, channels, multiplier = filters.shape
    n, height, width, _ = x.shape
    rows, top, bottom = same(height, kh, stride, dilation) if padding == "SAME" else (0, 0, 0)
    columns, left, right = same(width, kw, stride, dilation) if padding == "SAME" else (0, 0, 0)
    x = np.pad(x, ((0, 0), (top, bottom), (left, right), (0, 0)))
    if padding == "VALID":
        rows = (height - (kh - 1) * dilation - 1) // stride + 1
        columns = (width - (kw - 1) * dilation - 1) // stride + 1
    out = np.zeros((n, rows, columns, channels, multiplier), np.float32)
    for i in range(rows):
        for j in range(columns):
            for a in range(kh):
                for b in range(kw):
                    pixel = x[:, i * stride + a * dilation, j * stride + b * dilation]
                    out[:, i, j] += pixel[:, :, None] * filters[a, b]
    return out


def largest(x: NDArray[np.float32], kernel: int, stride: int, padding: str) -> NDArray[np.float32]:
    """Max pooling of images (n, h, w, c); zeros that are padded never win."""
    n, height, width, channels = x.shape
    if padding == "SAME":
        (rows, top, bottom), (columns, left, right) = (same(side, kernel, stride) for side in (height, width))
        x = np.pad(x, ((0, 0), (top, bottom), (left, right), (0, 0)), constant_values=-np.inf)
    else:
        rows, columns = ((side - kernel) // stride + 1 for side in (height, width))
    out = np.empty((n, rows, columns, channels), np.float32)
    for i in range(rows):
        for j in range(columns):
            part = x[:, i * stride : i * stride + kernel, j * stride : j * stride + kernel]
            out[:, i, j] = part.max(axis=(1, 2))
    return out


def resized(
    x: NDArray[np.float32], size: tuple[int, int], *, nearest: bool, corners: bool, half: bool
) -> NDArray[np.float32]:
    """Images (n, h, w, c) at another size, pixel by pixel, as TensorFlow's `image_resizer_state.h` has it."""
    out = np.empty((x.shape[0], *size, x.shape[3]), np.float32)
    for i in range(size[0]):
        for j in range(size[1]):
            v, u = (
                _source(k, length, new, corners=corners, half=half, nearest=nearest)
                for k, length, new in ((i, x.shape[1], size[0]), (j, x.shape[2], size[1]))
            )
            if nearest:
                out[:, i, j] = x[:, int(v), int(u)]
                continue
            above, before = int(np.floor(v)), int(np.floor(u))
            below, behind = min(above + 1, x.shape[1] - 1), min(before + 1, x.shape[2] - 1)
            down, along = v - above, u - before
            upper = x[:, above, before] * (1 - along) + x[:, above, behind] * along
            lower = x[:, below, before] * (1 - along) + x[:, below, behind] * along
            out[:, i, j] = upper * (1 - down) + lower * down
    return out


def _source(k: int, length: int, new: int, *, corners: bool, half: bool, nearest: bool) -> float:
    scale = (length - 1) / (new - 1) if corners and new > 1 else length / new
    place = (k + 0.5) * scale - (0 if nearest else 0.5) if half else k * scale
    if nearest:
        return min(math.floor(place + 0.5) if corners else math.floor(place), length - 1)
    return min(max(place, 0.0), length - 1)
