"""TensorFlow.js graph models: a graph as JSON beside one file of weights.

Source: TensorFlow.js, `tfjs-core/src/io/types.ts` (`ModelJSON`, `WeightsManifestEntry`) for the files, TensorFlow's
`graph.proto` and `attr_value.proto` for the nodes in them; int64 is written as text there, and bytes as base64.
"""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Base64Bytes, TypeAdapter, ValidationError

from mcap_landmarks.errors import ModelError

Weight = NDArray[np.generic]
"""32 bits each, float or int."""
Attribute = str | float | tuple[int, ...]
"""An attribute: words, a number (also for true and false), or whole numbers."""
_DTYPES: Mapping[str, np.dtype[np.generic]] = {"float32": np.dtype("<f4"), "int32": np.dtype("<i4")}


@dataclass(frozen=True, slots=True)
class TfNode:
    """One node: its operation, the tensors that it reads (`name`, or `name:i` for a later output), its attributes."""

    name: str
    op: str
    inputs: tuple[str, ...]
    attributes: Mapping[str, Attribute] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class TfGraph:
    """A graph: nodes and weights by name, and the nodes that it takes and gives, with their shapes.

    `what` names it in messages.
    """

    what: str
    nodes: Mapping[str, TfNode]
    weights: Mapping[str, Weight]
    inputs: Mapping[str, tuple[int, ...]]
    outputs: Mapping[str, tuple[int, ...]]


def read_graph(model: bytes, weights: bytes, what: str) -> TfGraph:
    """The graph of a model's JSON and its weights.

    Raises:
        ModelError: it is no such model, or the weights are not those of the graph.
    """
    try:
        document = TypeAdapter(_Document).validate_json(model)
        nodes = [_node(entry) for entry in document.modelTopology.node]
        arrays = dict(_weights([entry for group in document.weightsManifest for entry in group.weights], weights))
    except (ValidationError, ValueError) as error:
        told = error.errors()[0] if isinstance(error, ValidationError) else None
        reason = f"{'.'.join(map(str, told['loc']))}: {told['msg']}" if told else str(error)
        raise ModelError(f"{what}: not a TensorFlow.js graph model ({reason}); fetch it again") from error
    inputs, outputs = _shapes(document.signature.inputs), _shapes(document.signature.outputs)
    return TfGraph(what, {node.name: node for node in nodes}, arrays, inputs, outputs)


@dataclass(frozen=True, slots=True)
class _List:
    s: Sequence[Base64Bytes] = ()
    i: Sequence[int] = ()


@dataclass(frozen=True, slots=True)
class _Value:
    """One of these; types, shapes and tensors are not looked at."""

    s: Base64Bytes | None = None
    i: int | None = None
    f: float | None = None
    b: bool | None = None
    list: _List | None = None


@dataclass(frozen=True, slots=True)
class _Node:
    name: str
    op: str
    input: Sequence[str] = ()
    attr: Mapping[str, _Value] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class _Topology:
    node: Sequence[_Node]


@dataclass(frozen=True, slots=True)
class _Length:
    size: int


@dataclass(frozen=True, slots=True)
class _Shape:
    dim: Sequence[_Length] = ()


@dataclass(frozen=True, slots=True)
class _Tensor:
    tensorShape: _Shape  # noqa: N815 - as it is written in the file


@dataclass(frozen=True, slots=True)
class _Signature:
    inputs: Mapping[str, _Tensor]
    outputs: Mapping[str, _Tensor]


@dataclass(frozen=True, slots=True)
class _Quantization:
    dtype: Literal["float16"]


@dataclass(frozen=True, slots=True)
class _Entry:
    name: str
    shape: Sequence[int]
    dtype: Literal["float32", "int32"]
    quantization: _Quantization | None = None


@dataclass(frozen=True, slots=True)
class _Group:
    weights: Sequence[_Entry]


@dataclass(frozen=True, slots=True)
class _Document:
    modelTopology: _Topology  # noqa: N815 - as it is written in the file
    weightsManifest: Sequence[_Group]  # noqa: N815 - as it is written in the file
    signature: _Signature


def _node(entry: _Node) -> TfNode:
    attributes = {name: _attribute(value) for name, value in entry.attr.items()}
    # A name with ^ is waited for, not read.
    reads = tuple(name for name in entry.input if not name.startswith("^"))
    return TfNode(entry.name, entry.op, reads, attributes)


def _attribute(value: _Value) -> Attribute:
    if value.s is not None:
        return value.s.decode()
    if value.list is not None:
        return " ".join(word.decode() for word in value.list.s) if value.list.s else tuple(value.list.i)
    return next((float(number) for number in (value.i, value.f, value.b) if number is not None), "")


def _shapes(tensors: Mapping[str, _Tensor]) -> dict[str, tuple[int, ...]]:
    return {
        name.removesuffix(":0"): tuple(length.size for length in tensor.tensorShape.dim)
        for name, tensor in tensors.items()
    }


def _weights(entries: Sequence[_Entry], content: bytes) -> Iterator[tuple[str, Weight]]:
    """The weights by name: they lie one behind the other, in the order of the manifest."""
    start = 0
    for entry in entries:
        dtype = _DTYPES[entry.dtype]
        stored: np.dtype[np.generic] = np.dtype("<f2") if entry.quantization else dtype
        count = math.prod(entry.shape)
        if count < 0 or start + count * stored.itemsize > len(content):
            raise ValueError(f"{len(content)} bytes of weights do not reach for {entry.name}")
        flat = np.frombuffer(content, stored, count, start)
        yield entry.name, flat.astype(dtype).reshape(tuple(entry.shape))
        start += count * stored.itemsize
    if start != len(content):
        raise ValueError(f"{len(content)} bytes of weights, where the graph has {start}")
