"""Convert a TensorFlow.js graph to ONNX; needs the extra `models`."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from graphlib import CycleError, TopologicalSorter

from mcap_landmarks.errors import ModelError
from mcap_landmarks.networks.onnx_graph import OnnxGraph, Value
from mcap_landmarks.networks.tf_operations import OPERATIONS, Call, Tensor, variable
from mcap_landmarks.networks.tfjs import TfGraph, TfNode


@dataclass(frozen=True, slots=True)
class OnnxNames:
    """What inputs and outputs are called, by the names that the original has for them; only these outputs are given."""

    inputs: Mapping[str, str]
    outputs: Mapping[str, str]


def onnx_bytes(graph: TfGraph, names: OnnxNames, metadata: Mapping[str, str]) -> bytes:
    """The bytes of the ONNX model, the same every time.

    Raises:
        ModelError: the graph has an operation, or a use of one, that cannot be converted; it is named.
    """
    made = OnnxGraph()
    tensors: dict[str, Tensor] = {}
    for name in _in_order(graph, tuple(names.outputs)):
        node = graph.nodes[name]
        found = list(_converted(node, graph, tensors, made, names))
        tensors.update({f"{name}:{i}" if i else name: tensor for i, tensor in enumerate(found)})
    inputs = {names.inputs[name]: shape for name, shape in graph.inputs.items()}
    outputs = {}
    for original, name in names.outputs.items():
        value = variable(graph.nodes[original], tensors[original], graph)
        outputs[name] = (made.ordered(value, range(len(value.order))), graph.outputs[original])
    return made.model(inputs, outputs, metadata)


def _in_order(graph: TfGraph, outputs: Sequence[str]) -> Iterator[str]:
    """The nodes that some outputs need, each after those that it reads."""
    reads: dict[str, list[str]] = {}
    waiting = list(outputs)
    while waiting:
        name = waiting.pop()
        if name not in graph.nodes:
            raise ModelError(f"{graph.what}: it has no node {name}; fetch it again")
        if name not in reads:
            reads[name] = [read.partition(":")[0] for read in graph.nodes[name].inputs]
            waiting += reads[name]
    try:
        return iter([*TopologicalSorter(reads).static_order()])
    except CycleError as error:
        raise ModelError(f"{graph.what}: its nodes read each other in a circle; fetch it again") from error


def _converted(
    node: TfNode, graph: TfGraph, tensors: Mapping[str, Tensor], made: OnnxGraph, names: OnnxNames
) -> Iterator[Tensor]:
    if node.op == "Const":
        yield graph.weights[node.name]
    elif node.op == "Placeholder":
        yield Value(names.inputs[node.name], tuple(range(len(graph.inputs[node.name]))))
    elif node.op in OPERATIONS:
        # The first output is named with or without its number.
        reads = [tensors[name.removesuffix(":0")] for name in node.inputs]
        yield from OPERATIONS[node.op](Call(node, reads, graph, made))
    else:
        known = ", ".join(sorted(OPERATIONS))
        raise ModelError(f"{graph.what}: {node.name} is a {node.op}, which cannot be converted; there are {known}")
