"""An ONNX graph under construction from tensors of TensorFlow's layout, whose axes are put in order only where needed.

Needs the extra `models`: only what converts networks imports it.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import onnx
from onnx import TensorProto, helper, numpy_helper

from mcap_landmarks.networks.tfjs import Weight

NHWC, NCHW = (0, 1, 2, 3), (0, 2, 3, 1)
"""Orders of a tensor of images: as TensorFlow has them, and where ONNX's tensor has the channels second."""
_OPSET, _IR_VERSION = 18, 10
"""As PyTorch's exporter has them today, and both known to onnxruntime 1.20."""


@dataclass(frozen=True, slots=True)
class Value:
    """A tensor of the original graph: axis i of it is axis `order[i]` of the ONNX tensor `name`."""

    name: str
    order: tuple[int, ...]


OnnxAttribute = int | float | str | Sequence[int]


class OnnxGraph:
    """Nodes and constants so far; every method that adds some gives the name of their output."""

    def __init__(self) -> None:
        self._nodes: list[onnx.NodeProto] = []
        self._constants: list[onnx.TensorProto] = []

    def node(self, op: str, *inputs: str, **attributes: OnnxAttribute) -> str:
        """One node with one output."""
        return self.nodes(op, inputs, 1, **attributes)[0]

    def nodes(self, op: str, inputs: Sequence[str], count: int, **attributes: OnnxAttribute) -> list[str]:
        """One node with several outputs."""
        outputs = [f"{op}_{len(self._nodes)}_{i}" for i in range(count)]
        self._nodes.append(_node(op, inputs, outputs, attributes))
        return outputs

    def constant(self, array: Weight | Sequence[int] | float) -> str:
        """A constant; whole numbers become 64 bits wide, as ONNX has shapes and sizes."""
        values = np.asarray(array)
        name = f"constant_{len(self._constants)}"
        wide = values.astype(np.int64 if values.dtype.kind in "iu" else np.float32)
        self._constants.append(numpy_helper.from_array(np.ascontiguousarray(wide).reshape(values.shape), name))
        return name

    def ordered(self, value: Value, order: Sequence[int]) -> str:
        """The ONNX tensor of a value whose axes are in an order, transposed if it has another."""
        if value.order == tuple(order):
            return value.name
        # Axis order[i] of the new tensor is axis i of the value, which is axis value.order[i] of the old one.
        return self.node("Transpose", value.name, perm=[value.order[order.index(axis)] for axis in range(len(order))])

    def laid_out(self, array: Weight, order: Sequence[int]) -> str:
        """A constant of the original graph for broadcasting against a tensor of an order."""
        if array.ndim == 0:
            return self.constant(array)
        whole = array.reshape((1,) * (len(order) - array.ndim) + array.shape)
        return self.constant(whole.transpose(np.argsort(order)))

    def model(
        self,
        inputs: Mapping[str, Sequence[int]],
        outputs: Mapping[str, tuple[str, Sequence[int]]],
        metadata: Mapping[str, str],
    ) -> bytes:
        """The bytes of a model with the shapes of its inputs, and by name the tensors that it gives, with theirs."""
        nodes = [*self._nodes]
        nodes += [helper.make_node("Identity", [tensor], [name]) for name, (tensor, _) in outputs.items()]
        given = [helper.make_tensor_value_info(name, TensorProto.FLOAT, shape) for name, shape in inputs.items()]
        found = [helper.make_tensor_value_info(name, TensorProto.FLOAT, shape) for name, (_, shape) in outputs.items()]
        graph = helper.make_graph(nodes, "converted", given, found, self._constants)
        imports = [helper.make_opsetid("", _OPSET)]
        model = helper.make_model(graph, opset_imports=imports, ir_version=_IR_VERSION, producer_name="mcap-landmarks")
        helper.set_model_props(model, dict(sorted(metadata.items())))
        onnx.checker.check_model(model)
        return bytes(model.SerializeToString(deterministic=True))


def _node(
    op: str, inputs: Sequence[str], outputs: Sequence[str], attributes: Mapping[str, OnnxAttribute]
) -> onnx.NodeProto:
    node = helper.make_node(op, inputs, outputs)
    node.attribute.extend(helper.make_attribute(name, value) for name, value in sorted(attributes.items()))
    return node
