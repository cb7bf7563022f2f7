"""Every operation that can be converted, on small graphs, against a slow evaluation of TensorFlow's own definition."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import onnxruntime
import pytest
from mcap_landmarks.errors import ModelError
from mcap_landmarks.networks.tf_operations import OPERATIONS
from mcap_landmarks.networks.tfjs import read_graph
from mcap_landmarks.networks.tfjs_to_onnx import OnnxNames, onnx_bytes
from numpy.typing import ArrayLike, NDArray

from tests.networks.tf_graphs import Built, largest, resized, window_sums

F32 = NDArray[np.float32]
RNG = np.random.default_rng(5)
SHAPE = (1, 7, 10, 3)
"""Images with an odd and an even side: SAME pads them differently."""


def drawn(*shape: int) -> F32:
    return RNG.normal(size=shape).astype(np.float32)


def ints(*values: ArrayLike) -> NDArray[np.int32]:
    return np.asarray(values, np.int32)


@dataclass(frozen=True)
class Case:
    """A node of an operation with x as its first input, constants behind it, and what it gives."""

    op: str
    gives: Callable[[F32], F32]
    constants: Mapping[str, Any] = field(default_factory=dict)
    attributes: Mapping[str, object] = field(default_factory=dict)
    shape: tuple[int, ...] = SHAPE


FILTERS, BY_CHANNEL, BIAS, ALPHA = drawn(3, 3, 3, 4), drawn(3, 3, 3, 2), drawn(4), np.abs(drawn(4))
BIAS_6, PADS = drawn(6), ints([0, 0], [1, 2], [0, 3], [0, 0])


def conv(x: F32, stride: int, padding: str, dilation: int = 1) -> F32:
    # Over the channels of one filter all products add up.
    spread = [window_sums(x, FILTERS[..., m : m + 1], stride, padding, dilation).sum(axis=3) for m in range(4)]
    return np.concatenate(spread, axis=3)


def depthwise(x: F32, stride: int, padding: str) -> F32:
    sums = window_sums(x, BY_CHANNEL, stride, padding)
    return sums.reshape(*sums.shape[:3], -1)


def sides(stride: int, padding: str, **more: object) -> dict[str, object]:
    return {"strides": [1, stride, stride, 1], "padding": padding, "data_format": "NHWC", **more}


def resize(op: str, size: tuple[int, int], *, corners: bool, half: bool) -> Case:
    nearest = op == "ResizeNearestNeighbor"
    flags = {"align_corners": corners, "half_pixel_centers": half}

    def gives(x: F32) -> F32:
        return resized(x, size, nearest=nearest, corners=corners, half=half)

    return Case(op, gives, {"size": ints(*size)}, flags)


CASES = {
    "conv same 2": Case("Conv2D", lambda x: conv(x, 2, "SAME"), {"w": FILTERS}, sides(2, "SAME")),
    "conv valid 1": Case("Conv2D", lambda x: conv(x, 1, "VALID"), {"w": FILTERS}, sides(1, "VALID")),
    "conv dilated": Case(
        "Conv2D", lambda x: conv(x, 1, "SAME", 2), {"w": FILTERS}, sides(1, "SAME", dilations=[1, 2, 2, 1])
    ),
    "depthwise": Case("DepthwiseConv2dNative", lambda x: depthwise(x, 2, "SAME"), {"w": BY_CHANNEL}, sides(2, "SAME")),
    "fused bias": Case(
        "_FusedConv2D",
        lambda x: conv(x, 2, "SAME") + BIAS,
        {"w": FILTERS, "b": BIAS},
        sides(2, "SAME", fused_ops=["BiasAdd"]),
    ),
    "fused relu6": Case(
        "_FusedConv2D",
        lambda x: np.clip(conv(x, 2, "SAME") + BIAS, 0, 6),
        {"w": FILTERS, "b": BIAS},
        sides(2, "SAME", fused_ops=["BiasAdd", "Relu6"]),
    ),
    "fused leaky": Case(
        "_FusedConv2D",
        lambda x: leaky(conv(x, 1, "VALID") + BIAS, 0.3),
        {"w": FILTERS, "b": BIAS},
        sides(1, "VALID", fused_ops=["BiasAdd", "LeakyRelu"], leakyrelu_alpha=0.3),
    ),
    "fused prelu": Case(
        "_FusedConv2D",
        lambda x: leaky(conv(x, 1, "SAME") + BIAS, ALPHA),
        {"w": FILTERS, "b": BIAS, "a": ALPHA},
        sides(1, "SAME", fused_ops=["BiasAdd", "Prelu"]),
    ),
    "fused depthwise": Case(
        "FusedDepthwiseConv2dNative",
        lambda x: np.maximum(depthwise(x, 2, "SAME") + BIAS_6, 0),
        {"w": BY_CHANNEL, "b": BIAS_6},
        sides(2, "SAME", fused_ops=["BiasAdd", "Relu"]),
    ),
    "max same": Case("MaxPool", lambda x: largest(x, 3, 2, "SAME"), {}, sides(2, "SAME", ksize=[1, 3, 3, 1])),
    "max valid": Case("MaxPool", lambda x: largest(x, 2, 2, "VALID"), {}, sides(2, "VALID", ksize=[1, 2, 2, 1])),
    "nearest": resize("ResizeNearestNeighbor", (14, 20), corners=False, half=False),
    "nearest half": resize("ResizeNearestNeighbor", (5, 13), corners=False, half=True),
    "nearest corners": resize("ResizeNearestNeighbor", (13, 19), corners=True, half=False),
    "bilinear": resize("ResizeBilinear", (9, 21), corners=False, half=False),
    "bilinear half": resize("ResizeBilinear", (14, 20), corners=False, half=True),
    "bilinear corners": resize("ResizeBilinear", (4, 17), corners=True, half=False),
    "add": Case("Add", lambda x: x + BIAS[:3], {"b": BIAS[:3]}),
    "add v2": Case("AddV2", lambda x: x + np.float32(2), {"b": np.array(2, np.float32)}),
    "bias": Case("BiasAdd", lambda x: x + BIAS[:3], {"b": BIAS[:3]}),
    "mul": Case("Mul", lambda x: x * FILTERS[:1, :1, :, 0], {"b": FILTERS[:1, :1, :, 0]}),
    "relu": Case("Relu", lambda x: np.maximum(x, 0)),
    "relu6": Case("Relu6", lambda x: np.clip(x, 0, 6)),
    "leaky": Case("LeakyRelu", lambda x: leaky(x, 0.1), {}, {"alpha": 0.1}),
    "prelu": Case("Prelu", lambda x: leaky(x, ALPHA[:3]), {"a": ALPHA[:3]}),
    "sigmoid": Case("Sigmoid", lambda x: 1 / (1 + np.exp(-x))),
    "identity": Case("Identity", lambda x: x),
    "pad": Case("Pad", lambda x: np.pad(x, PADS), {"p": PADS}),
    "pad v2": Case("PadV2", lambda x: np.pad(x, PADS, constant_values=-9), {"p": PADS, "v": np.array(-9, np.float32)}),
    "reshape": Case("Reshape", lambda x: x.reshape(1, -1, 6), {"s": ints(1, -1, 6)}),
    "transpose": Case("Transpose", lambda x: x.transpose(0, 3, 1, 2), {"p": ints(0, 3, 1, 2)}),
}


def leaky(x: F32, alpha: float | F32) -> F32:
    return np.where(x < 0, np.float32(1) * alpha * x, x).astype(np.float32)


def run(built: Built, x: F32, outputs: Mapping[str, F32]) -> dict[str, F32]:
    """What the converted graph gives."""
    graph = read_graph(*built.files({name: expected.shape for name, expected in outputs.items()}), "test")
    content = onnx_bytes(graph, OnnxNames({"x": "images"}, {name: f"out_{name}" for name in outputs}), {"a": "b"})
    session = onnxruntime.InferenceSession(content)
    names = [f"out_{name}" for name in outputs]
    return dict(zip(outputs, session.run(names, {"images": x}), strict=True))


@pytest.mark.parametrize("name", CASES)
def test_an_operation_gives_what_tensorflow_defines(name: str) -> None:
    case, x = CASES[name], drawn(*CASES[name].shape) * 4
    built = Built(case.shape)
    inputs = ["x", *(built.constant(key, array) for key, array in case.constants.items())]
    built.node("y", case.op, inputs, case.attributes)
    expected = case.gives(x)
    found = run(built, x, {"y": expected})["y"]
    assert found.shape == expected.shape
    np.testing.assert_allclose(found, expected, atol=2e-5, rtol=2e-5)


def test_every_operation_is_tried() -> None:
    joining = {"ConcatV2", "SplitV", "SparseToDense"}
    assert {case.op for case in CASES.values()} | joining == OPERATIONS.keys()


def test_a_chain_keeps_the_order_of_axes() -> None:
    """As other converters write them: transposed to and fro, joined with what has another order, cut, put in rows."""
    built, x = Built((1, 3, 8, 6)), drawn(1, 3, 8, 6)
    for name, perm in (("to", (0, 2, 3, 1)), ("back", (0, 3, 1, 2))):
        built.constant(name, ints(*perm))
    for name, value in (("axis", ints(1)[0:1].reshape(())), ("sizes", ints(2, 2)), ("rows", ints(1, 2, -1))):
        built.constant(name, value)
    built.constant("w", FILTERS)
    built.node("a", "Transpose", ["x", "to"])
    built.node("b", "Conv2D", ["a", "w"], sides(1, "SAME"))
    built.node("c", "Transpose", ["b", "back"])
    built.node("d", "ConcatV2", ["c", "x", "axis"])  # 4 and 3 channels
    built.node("e", "ConcatV2", ["x", "c", "axis"])
    built.node("f", "SplitV", ["c", "sizes", "axis"], {"num_split": 2})
    built.node("g", "Add", ["f:0", "f:1"])
    built.node("h", "Reshape", ["f:1", "rows"])
    rows = x.transpose(0, 2, 3, 1)
    c = conv(rows, 1, "SAME").transpose(0, 3, 1, 2)
    expected = {
        "d": np.concatenate([c, x], axis=1),
        "e": np.concatenate([x, c], axis=1),
        "g": c[:, :2] + c[:, 2:],
        "h": c[:, 2:].reshape(1, 2, -1),
    }
    for name, found in run(built, x, expected).items():
        np.testing.assert_allclose(found, expected[name], atol=1e-5, err_msg=name)


def test_shapes_that_another_converter_worked_out_are_folded() -> None:
    built, x = Built((1, 4)), drawn(1, 4)
    built.constant("where", np.zeros((0, 1), np.int32))
    built.constant("size", ints(2))
    built.constant("none", np.zeros(0, np.int32))
    built.constant("zero", np.array(0, np.int32))
    built.constant("base", ints(2, 2))
    built.node("dense", "SparseToDense", ["where", "size", "none", "zero"])
    built.node("shape", "AddV2", ["base", "dense"])
    built.node("y", "Reshape", ["x", "shape"])
    np.testing.assert_array_equal(run(built, x, {"y": x.reshape(2, 2)})["y"], x.reshape(2, 2))


def test_the_same_graph_gives_the_same_bytes() -> None:
    built = Built(SHAPE)
    built.node("y", "Conv2D", ["x", built.constant("w", FILTERS)], sides(2, "SAME"))
    graph = read_graph(*built.files({"y": (1, 4, 5, 4)}), "test")
    names = OnnxNames({"x": "images"}, {"y": "out"})
    assert onnx_bytes(graph, names, {"b": "2", "a": "1"}) == onnx_bytes(graph, names, {"a": "1", "b": "2"})


@pytest.mark.parametrize(
    ("op", "attributes", "said"),
    [
        ("Einsum", {}, "y is a Einsum, which cannot be converted; there are Add, AddV2"),
        ("Conv2D", sides(1, "EXPLICIT"), "y (Conv2D) cannot be converted: its padding is EXPLICIT"),
        ("Conv2D", sides(1, "SAME") | {"data_format": "NCHW"}, "its tensor is NCHW, where NHWC is expected"),
        ("Conv2D", {"strides": [2, 1, 1, 1], "padding": "SAME"}, "strides go over images or channels"),
        ("_FusedConv2D", sides(1, "SAME", fused_ops=["FusedBatchNorm"]), "it is fused with FusedBatchNorm"),
        ("Reshape", {}, "input 1 is no constant"),
        ("Conv2D", {}, "its nodes read each other in a circle"),
    ],
)
def test_what_cannot_be_converted_is_named(op: str, attributes: Mapping[str, object], said: str) -> None:
    built = Built(SHAPE)
    weights = built.constant("w", FILTERS)
    circle = "circle" in said
    built.node("y", op, ["y" if circle else "x", "x" if op == "Reshape" else weights, weights], attributes)
    graph = read_graph(*built.files({"y": SHAPE}), "model.json")
    with pytest.raises(ModelError, match=r"model\.json") as error:
        onnx_bytes(graph, OnnxNames({"x": "images"}, {"y": "out"}), {})
    assert said in str(error.value)
