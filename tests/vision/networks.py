"""YOLOv5 networks with random weights, and networks that answer with constants, as ONNX files."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import onnx
from mcap_landmarks.vision.families.yolov5 import ANCHORS, Form
from numpy.typing import ArrayLike, DTypeLike, NDArray
from onnx import TensorProto, helper, numpy_helper

SIZES = {"n": (0.33, 0.25), "s": (0.33, 0.50), "m": (0.67, 0.75), "l": (1.0, 1.0), "x": (1.33, 1.25)}
"""Depth and width of each size of YOLOv5."""
COCO_PARAMETERS = {"n": 1_867_405, "s": 7_225_885, "m": 21_172_173, "l": 46_533_693, "x": 86_705_005}
"""Parameters that its authors publish for 80 classes, batch normalisation folded."""
STRIDES = (8, 16, 32)
NO_METADATA: Mapping[str, str] = {}

Side = int | str


@dataclass(frozen=True, slots=True)
class Export:
    """How a network is written. Sides, and a number of images, that are words are free."""

    height: Side = 640
    width: Side = 640
    batch: Side = 1
    form: Form = "decoded"
    half: bool = False
    int8: bool = False
    objectness_bias: float = 0.0
    seed: int = 0


class Graph:
    """A graph under construction: each method adds nodes and gives the name of their output."""

    def __init__(self, export: Export) -> None:
        self.export, self.rng = export, np.random.default_rng(export.seed)
        self.dtype = np.float16 if export.half else np.float32
        self.nodes: list[Any] = []
        self.initializers: list[Any] = []
        self.parameters = 0

    def node(self, kind: str, *inputs: str, count: int = 1, **attributes: object) -> str:
        """One node; of several outputs the names are numbered."""
        name = f"{kind}_{len(self.nodes)}"
        outputs = [name] if count == 1 else [f"{name}_{i}" for i in range(count)]
        self.nodes.append(helper.make_node(kind, list(inputs), outputs, **attributes))
        return name

    def constant(self, array: ArrayLike, dtype: DTypeLike | None = None) -> str:
        """An initializer, of the network's own type unless another is given."""
        name = f"constant_{len(self.initializers)}"
        self.initializers.append(numpy_helper.from_array(np.asarray(array, dtype or self.dtype), name))
        return name

    def conv(
        self, x: str, size: tuple[int, int], kernel: int = 1, stride: int = 1, *, bias: NDArray[Any] | None = None
    ) -> str:
        """A convolution of (channels in, out) with SiLU, or with `bias` and nothing after it."""
        c_in, c_out = size
        gain = np.sqrt(2.6) if bias is None else 0.1  # keeps signals alive through SiLU, and the heads' logits small
        weights = self.rng.normal(0, gain / np.sqrt(c_in * kernel**2), (c_out, c_in, kernel, kernel))
        self.parameters += weights.size + c_out
        if self.export.int8:
            scale = np.abs(weights).max() / 127
            whole = self.constant(np.round(weights / scale), np.int8)
            named = self.node("DequantizeLinear", whole, self.constant(scale), self.constant(0, np.int8))
            step, zero = self.constant(0.05), self.constant(0, np.int8)
            x = self.node("DequantizeLinear", self.node("QuantizeLinear", x, step, zero), step, zero)
        else:
            named = self.constant(weights)
        pad = 2 if kernel == 6 else kernel // 2
        offsets = self.constant(self.rng.normal(0, 0.1, c_out) if bias is None else bias)
        shape = {"kernel_shape": [kernel] * 2, "strides": [stride] * 2, "pads": [pad] * 4}
        y = self.node("Conv", x, named, offsets, **shape)
        return y if bias is not None else self.node("Mul", y, self.node("Sigmoid", y))

    def c3(self, x: str, size: tuple[int, int], depth: int, *, shortcut: bool = True) -> str:
        """The bottleneck block with three convolutions."""
        inner = size[1] // 2
        y = self.conv(x, (size[0], inner))
        beside = self.conv(x, (size[0], inner))
        for _ in range(depth):
            z = self.conv(self.conv(y, (inner, inner)), (inner, inner), 3)
            y = self.node("Add", y, z) if shortcut else z
        return self.conv(self.node("Concat", y, beside, axis=1), (2 * inner, size[1]))

    def sppf(self, x: str, channels: int) -> str:
        """Spatial pyramid pooling, the fast form."""
        levels = [self.conv(x, (channels, channels // 2))]
        for _ in range(3):
            levels.append(self.node("MaxPool", levels[-1], kernel_shape=[5, 5], strides=[1, 1], pads=[2] * 4))
        return self.conv(self.node("Concat", *levels, axis=1), (2 * channels, channels))

    def up(self, x: str, beside: str) -> str:
        """Twice the size, with another level joined on."""
        scales = self.constant([1, 1, 2, 2], np.float32)
        return self.node("Concat", self.node("Resize", x, "", scales, mode="nearest"), beside, axis=1)

    def head(self, x: str, channels: int, index: int, classes: int) -> str:
        """One head of the detector in the form that is exported."""
        columns = 5 + classes
        bias = self.rng.normal(0, 1, (3, columns))
        bias[:, 4] += self.export.objectness_bias
        plane = self.conv(x, (channels, 3 * columns), bias=bias.ravel())
        if self.export.form == "planes":
            return plane
        split = self.node("Split", plane, self.constant([columns] * 3, np.int64), count=3, axis=1)
        axis = self.constant([1], np.int64)
        parts = [self.node("Transpose", f"{split}_{i}", perm=[0, 2, 3, 1]) for i in range(3)]
        raw = self.node("Concat", *(self.node("Unsqueeze", part, axis) for part in parts), axis=1)
        return raw if self.export.form == "heads" else self._decoded(raw, index, columns)

    def _decoded(self, raw: str, index: int, columns: int) -> str:
        shares = self.node("Sigmoid", raw)
        parts = self.node("Split", shares, self.constant([2, 2, columns - 4], np.int64), count=3, axis=4)
        flat = self.node("ReduceMax", shares, self.constant([4], np.int64), keepdims=1)
        ones = self.node("Add", self.node("Mul", flat, self.constant(0)), self.constant(1))
        grid = self.node(
            "Concat", *(self.node("CumSum", ones, self.constant(axis, np.int64)) for axis in (3, 2)), axis=4
        )
        twice = self.node("Mul", f"{parts}_0", self.constant(2))
        centres = self.node("Add", self.node("Sub", twice, self.constant(1.5)), grid)  # the grid begins at 1
        anchors = self.constant(ANCHORS["yolov5"][index].reshape(1, 3, 1, 1, 2) * 4)
        sizes = self.node("Mul", self.node("Mul", f"{parts}_1", f"{parts}_1"), anchors)
        xy = self.node("Mul", centres, self.constant(STRIDES[index]))
        rows = self.node("Concat", xy, sizes, f"{parts}_2", axis=4)
        return self.node("Reshape", rows, self.constant([1, -1, columns], np.int64))


def yolov5(
    path: Path,
    names: Sequence[str],
    size: str = "n",
    export: Export = Export(),
    metadata: Mapping[str, str] | None = None,
) -> int:
    """Write a YOLOv5 of random weights; its number of parameters. `metadata` in place of names and stride."""
    graph, (depth, width) = Graph(export), SIZES[size]
    c = {i: max(8, int(np.ceil(64 * i * width / 8)) * 8) for i in (1, 2, 4, 8, 16)}
    n3, n6, n9 = (max(round(n * depth), 1) for n in (3, 6, 9))
    x = graph.conv(graph.conv("images", (3, c[1]), 6, 2), (c[1], c[2]), 3, 2)
    x = graph.conv(graph.c3(x, (c[2], c[2]), n3), (c[2], c[4]), 3, 2)
    level3 = graph.c3(x, (c[4], c[4]), n6)
    level4 = graph.c3(graph.conv(level3, (c[4], c[8]), 3, 2), (c[8], c[8]), n9)
    x = graph.c3(graph.conv(level4, (c[8], c[16]), 3, 2), (c[16], c[16]), n3)
    level5 = graph.conv(graph.sppf(x, c[16]), (c[16], c[8]))
    x = graph.c3(graph.up(level5, level4), (c[16], c[8]), n3, shortcut=False)
    middle = graph.conv(x, (c[8], c[4]))
    small = graph.c3(graph.up(middle, level3), (c[8], c[4]), n3, shortcut=False)
    x = graph.node("Concat", graph.conv(small, (c[4], c[4]), 3, 2), middle, axis=1)
    medium = graph.c3(x, (c[8], c[8]), n3, shortcut=False)
    x = graph.node("Concat", graph.conv(medium, (c[8], c[8]), 3, 2), level5, axis=1)
    large = graph.c3(x, (c[16], c[16]), n3, shortcut=False)
    heads = [
        graph.head(level, channels, i, len(names))
        for i, (level, channels) in enumerate(((small, c[4]), (medium, c[8]), (large, c[16])))
    ]
    outputs = heads if export.form != "decoded" else [graph.node("Concat", *heads, axis=1)]
    kind = TensorProto.FLOAT16 if export.half else TensorProto.FLOAT
    ranks = {"decoded": 3, "heads": 5, "planes": 4}
    free = [helper.make_tensor_value_info(name, kind, [None] * ranks[export.form]) for name in outputs]
    given = helper.make_tensor_value_info("images", kind, [export.batch, 3, export.height, export.width])
    built = helper.make_graph(graph.nodes, "yolov5", [given], free, graph.initializers)
    _save(path, built, {"names": str(dict(enumerate(names))), "stride": "32"} if metadata is None else metadata)
    return graph.parameters


def answering(
    path: Path,
    outputs: Mapping[str, NDArray[Any]],
    metadata: Mapping[str, str] = NO_METADATA,
    input_shape: Sequence[Side | None] = (1, 3, 64, 64),
    *,
    inputs: Sequence[str] = ("images",),
    sized: str = "",
) -> Path:
    """Write a network that gives the same outputs whatever it sees; `sized` is an input of two numbers beside."""
    half = any(array.dtype == np.float16 for array in outputs.values())
    kind = TensorProto.FLOAT16 if half else TensorProto.FLOAT
    nodes, constants = [], [numpy_helper.from_array(np.asarray(0, np.float16 if half else np.float32), "zero")]
    nodes.append(helper.make_node("ReduceMean", [inputs[0]], ["mean"], keepdims=0))
    nodes.append(helper.make_node("Mul", ["mean", "zero"], ["nothing"]))
    for name, array in outputs.items():
        constants.append(numpy_helper.from_array(array, f"{name}_content"))
        whole = np.issubdtype(array.dtype, np.integer)
        content = [f"{name}_content"]
        nodes.append(
            helper.make_node("Identity" if whole else "Add", content if whole else [*content, "nothing"], [name])
        )
    given = [helper.make_tensor_value_info(name, kind, input_shape) for name in inputs]
    given += [helper.make_tensor_value_info(sized, TensorProto.INT64, [1, 2])] if sized else []
    kinds = {name: helper.np_dtype_to_tensor_dtype(array.dtype) for name, array in outputs.items()}
    found = [helper.make_tensor_value_info(name, kinds[name], a.shape) for name, a in outputs.items()]
    _save(path, helper.make_graph(nodes, "answering", given, found, constants), metadata)
    return path


def averaging(path: Path) -> Path:
    """Write a network whose output [1, width] is as long as its input is wide."""
    node = helper.make_node("ReduceMean", ["images", "axes"], ["output"], keepdims=0)
    axes = numpy_helper.from_array(np.array([1, 2]), "axes")
    given = helper.make_tensor_value_info("images", TensorProto.FLOAT, [1, 3, "h", "w"])
    found = helper.make_tensor_value_info("output", TensorProto.FLOAT, [1, "w"])
    _save(path, helper.make_graph([node], "averaging", [given], [found], [axes]), NO_METADATA)
    return path


def _save(path: Path, graph: onnx.GraphProto, metadata: Mapping[str, str]) -> None:
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 18)], ir_version=10)
    helper.set_model_props(model, dict(metadata))
    onnx.save(model, str(path))
