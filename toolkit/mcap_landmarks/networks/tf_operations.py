"""TensorFlow's operations as ONNX's, one by one; needs the extra `models`.

Source: TensorFlow's `ops.pbtxt` (nn_ops, array_ops, image_ops) and ONNX's operators of opset 18. Tensors of images are
[image, row, column, channel] here, and [image, channel, row, column] there.
"""

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import TypeVar

import numpy as np

from mcap_landmarks.errors import ModelError
from mcap_landmarks.networks.onnx_graph import NCHW, OnnxAttribute, OnnxGraph, Value
from mcap_landmarks.networks.tfjs import Attribute, TfGraph, TfNode, Weight

_A = TypeVar("_A", str, float, tuple[int, ...])
Tensor = Value | Weight
"""What a node gives: a tensor that depends on the inputs, or one that is known."""


def variable(node: TfNode, tensor: Tensor, graph: TfGraph) -> Value:
    """A tensor that depends on the inputs.

    Raises:
        ModelError: it is a constant.
    """
    if isinstance(tensor, Value):
        return tensor
    raise ModelError(f"{graph.what}: {node.name} reads a constant where a tensor is expected; it cannot be converted")


@dataclass(frozen=True, slots=True)
class Call:
    """A node with what it reads, and the graph that it is to be added to."""

    node: TfNode
    tensors: Sequence[Tensor]
    graph: TfGraph
    made: OnnxGraph

    def value(self, index: int = 0) -> Value:
        """An input that depends on the model's."""
        return variable(self.node, self.tensors[index], self.graph)

    def known(self, index: int) -> Weight:
        """An input that is a constant."""
        tensor = self.tensors[index]
        if isinstance(tensor, Value):
            raise self.refused(f"input {index} is no constant")
        return tensor

    def whole(self, index: int) -> list[int]:
        """An input of constant whole numbers, in a row."""
        return [int(one) for one in self.known(index).ravel().tolist()]

    def attribute(self, name: str, default: _A) -> _A:
        """An attribute of the type of its default."""
        found: Attribute = self.node.attributes.get(name, default)
        return found if isinstance(found, type(default)) else default

    def refused(self, reason: str) -> ModelError:
        """The error that this node cannot be converted."""
        return ModelError(f"{self.graph.what}: {self.node.name} ({self.node.op}) cannot be converted: {reason}")


def _unary(op: str) -> "Callable[[Call], Iterator[Tensor]]":
    def convert(call: Call) -> Iterator[Tensor]:
        value = call.value()
        yield Value(call.made.node(op, value.name), value.order)

    return convert


def _identity(call: Call) -> Iterator[Tensor]:
    yield call.tensors[0]


def _leaky(call: Call) -> Iterator[Tensor]:
    value = call.value()
    # TensorFlow's own default.
    yield Value(call.made.node("LeakyRelu", value.name, alpha=call.attribute("alpha", 0.2)), value.order)


def _relu6(call: Call) -> Iterator[Tensor]:
    value = call.value()
    yield Value(call.made.node("Clip", value.name, call.made.constant(0.0), call.made.constant(6.0)), value.order)


def _binary(op: str) -> "Callable[[Call], Iterator[Tensor]]":
    def convert(call: Call) -> Iterator[Tensor]:
        one, other = call.tensors
        if isinstance(one, np.ndarray) and isinstance(other, np.ndarray):
            yield {"Add": np.add, "Mul": np.multiply}[op](one, other)
            return
        orders = [tensor.order for tensor in (one, other) if isinstance(tensor, Value)]
        order = orders[0]
        if any(len(known) != len(order) for known in orders):
            raise call.refused("its tensors have different numbers of axes")
        yield Value(call.made.node(op, *(_side(call, tensor, order) for tensor in (one, other))), order)

    return convert


def _prelu(call: Call) -> Iterator[Tensor]:
    value = call.value()
    yield Value(call.made.node("PRelu", value.name, _side(call, call.known(1), value.order)), value.order)


def _side(call: Call, tensor: Tensor, order: tuple[int, ...]) -> str:
    return call.made.ordered(tensor, order) if isinstance(tensor, Value) else call.made.laid_out(tensor, order)


def _conv(call: Call) -> Iterator[Tensor]:
    yield _convolved(call, call.known(1).transpose(3, 2, 0, 1), groups=1)


def _depthwise(call: Call) -> Iterator[Tensor]:
    yield _convolved(call, *_by_channel(call.known(1)))


def _fused(call: Call) -> Iterator[Tensor]:
    """A convolution with what comes behind it: a bias, then perhaps an activation."""
    by_channel = call.node.op == "FusedDepthwiseConv2dNative"
    filters, groups = _by_channel(call.known(1)) if by_channel else (call.known(1).transpose(3, 2, 0, 1), 1)
    bias, *activation = call.attribute("fused_ops", "").split()
    if bias != "BiasAdd" or len(activation) > 1 or not set(activation) <= set(_ACTIVATIONS):
        raise call.refused(f"it is fused with {bias} {' '.join(activation)}")
    value = _convolved(call, filters, groups, call.made.constant(call.known(2)))
    if not activation:
        yield value
        return
    attributes = {"alpha": call.attribute("leakyrelu_alpha", 0.2)}
    behind = TfNode(call.node.name, activation[0], call.node.inputs, attributes)
    yield from OPERATIONS[activation[0]](Call(behind, [value, *call.tensors[3:]], call.graph, call.made))


_ACTIVATIONS = ("Relu", "Relu6", "LeakyRelu", "Prelu", "Sigmoid")


def _by_channel(filters: Weight) -> tuple[Weight, int]:
    """Filters (rows, columns, channels, multiplier) as ONNX has those of so many groups as there are channels."""
    rows, columns, channels, multiplier = filters.shape
    return filters.transpose(2, 3, 0, 1).reshape(channels * multiplier, 1, rows, columns), channels


def _convolved(call: Call, filters: Weight, groups: int, *bias: str) -> Value:
    image = _image(call)
    name = call.made.node(
        "Conv",
        *(image, call.made.constant(filters), *bias),
        kernel_shape=filters.shape[2:],
        strides=_sides(call, "strides"),
        group=groups,
        **_spread(call, filters.shape[2:]),
    )
    return Value(name, NCHW)


def _spread(call: Call, kernel: Sequence[int]) -> dict[str, OnnxAttribute]:
    """The padding and dilation of a convolution; onnxruntime does not pad dilated ones by itself."""
    padding, dilations = _padding(call), _sides(call, "dilations")
    if padding == "VALID" or set(dilations) == {1}:
        return {"dilations": dilations, "auto_pad": padding}
    if set(_sides(call, "strides")) != {1}:
        raise call.refused("it is dilated, strided and padded at once")
    zeros = [(side - 1) * dilation for side, dilation in zip(kernel, dilations, strict=True)]
    return {"dilations": dilations, "pads": [*(n // 2 for n in zeros), *(n - n // 2 for n in zeros)]}


def _max_pool(call: Call) -> Iterator[Tensor]:
    sides = {"kernel_shape": _sides(call, "ksize"), "strides": _sides(call, "strides")}
    yield Value(call.made.node("MaxPool", _image(call), auto_pad=_padding(call), **sides), NCHW)


def _image(call: Call) -> str:
    layout = call.attribute("data_format", "NHWC")
    if layout != "NHWC" or len(call.value().order) != len(NCHW):
        raise call.refused(f"its tensor is {layout}, where NHWC is expected")
    return call.made.ordered(call.value(), NCHW)


def _sides(call: Call, name: str) -> tuple[int, ...]:
    images, *sides, channels = call.attribute(name, (1, 1, 1, 1))
    if images != 1 or channels != 1:
        raise call.refused(f"{name} go over images or channels")
    return tuple(sides)


def _padding(call: Call) -> str:
    """TensorFlow's SAME pads one more behind than before where the number is odd, as SAME_UPPER does."""
    padding = call.attribute("padding", "")
    if padding not in {"SAME", "VALID"}:
        raise call.refused(f"its padding is {padding}")
    return "SAME_UPPER" if padding == "SAME" else "VALID"


def _resize(call: Call) -> Iterator[Tensor]:
    corners, half = call.attribute("align_corners", 0.0), call.attribute("half_pixel_centers", 0.0)
    nearest = call.node.op == "ResizeNearestNeighbor"
    modes = {
        "mode": "nearest" if nearest else "linear",
        "coordinate_transformation_mode": "align_corners" if corners else "half_pixel" if half else "asymmetric",
        # What lies between two pixels goes to the later one where TensorFlow rounds or counts from centres.
        "nearest_mode": "round_prefer_ceil" if corners or half else "floor",
    }
    image, size = _image(call), call.made.constant(call.whole(1))
    # With `axes` in place of whole sizes, onnxruntime 1.31 loses the sizes where it moves a transposition.
    whole = call.made.node("Concat", call.made.node("Shape", image, start=0, end=2), size, axis=0)
    yield Value(call.made.node("Resize", image, "", "", whole, **modes), NCHW)


def _concat(call: Call) -> Iterator[Tensor]:
    order = call.value().order
    (axis,) = call.whole(-1)
    parts = [_side(call, tensor, order) for tensor in call.tensors[:-1]]
    yield Value(call.made.node("Concat", *parts, axis=order[axis]), order)


def _split(call: Call) -> Iterator[Tensor]:
    value, sizes = call.value(), call.whole(1)
    (axis,) = call.whole(2)
    parts = (value.name, call.made.constant(sizes))
    for name in call.made.nodes("Split", parts, len(sizes), axis=value.order[axis]):
        yield Value(name, value.order)


def _pad(call: Call) -> Iterator[Tensor]:
    value, pads = call.value(), call.known(1)[np.argsort(call.value().order)]
    with_what = call.known(2).reshape(()) if call.node.op == "PadV2" else np.zeros((), np.float32)
    inputs = (value.name, call.made.constant(pads.T.ravel()), call.made.constant(with_what))
    yield Value(call.made.node("Pad", *inputs), value.order)


def _reshape(call: Call) -> Iterator[Tensor]:
    value, shape = call.value(), call.whole(1)
    ordered = call.made.ordered(value, range(len(value.order)))
    yield Value(call.made.node("Reshape", ordered, call.made.constant(shape)), tuple(range(len(shape))))


def _transpose(call: Call) -> Iterator[Tensor]:
    value = call.value()
    yield Value(value.name, tuple(value.order[axis] for axis in call.whole(1)))


def _sparse_to_dense(call: Call) -> Iterator[Tensor]:
    """A known tensor, of another's making: all `default`, but for some entries."""
    places, _, entries, default = (call.known(i) for i in range(4))
    lengths = call.whole(1)
    if math.prod(lengths) > _MOST_SPARSE:
        raise call.refused(f"a constant of the shape {lengths} is no shape or size")
    dense = np.full(lengths, default, entries.dtype)
    if len(places):
        dense[tuple(places.reshape(len(places), -1).T)] = entries
    yield dense


_MOST_SPARSE = 1024
"""Sparse constants are the shapes that other converters worked out: a few numbers, never weights."""
OPERATIONS: Mapping[str, Callable[[Call], Iterator[Tensor]]] = {
    "Add": _binary("Add"),
    "AddV2": _binary("Add"),
    "BiasAdd": _binary("Add"),
    "ConcatV2": _concat,
    "Conv2D": _conv,
    "DepthwiseConv2dNative": _depthwise,
    "FusedDepthwiseConv2dNative": _fused,
    "Identity": _identity,
    "LeakyRelu": _leaky,
    "MaxPool": _max_pool,
    "Mul": _binary("Mul"),
    "Pad": _pad,
    "PadV2": _pad,
    "Prelu": _prelu,
    "Relu": _unary("Relu"),
    "Relu6": _relu6,
    "Reshape": _reshape,
    "ResizeBilinear": _resize,
    "ResizeNearestNeighbor": _resize,
    "Sigmoid": _unary("Sigmoid"),
    "SparseToDense": _sparse_to_dense,
    "SplitV": _split,
    "Transpose": _transpose,
    "_FusedConv2D": _fused,
}
