"""A trained network as an ONNX file that any YOLOv5 program reads: 80 classes of COCO, with names and provenance."""

import copy
import warnings
from collections.abc import Mapping
from pathlib import Path

import onnx
import torch
from mcap_landmarks.coco import NAMES
from torch import nn

from mcap_landmarks_generator.training.examples import CLASS_IDS
from mcap_landmarks_generator.training.network import STRIDES_PX, Convolution, Decoded, Network

_OPSET = 17
# The score of a class that was never trained: nothing.
_NEVER = -20.0


def export(network: Network, path: Path, size_px: tuple[int, int] | None, about: Mapping[str, str]) -> None:
    """Write the network with its metadata; `size_px` (height, width) fixes the input, None leaves it free."""
    model = Decoded(with_all_classes(fused(network))).eval()
    height, width = size_px or (480, 640)
    partial = path.with_suffix(".part")
    free = {"images": {2: "height", 3: "width"}, "output": {1: "boxes"}} if size_px is None else None
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DeprecationWarning)  # the newer exporter needs a package more
        torch.onnx.export(
            model,
            (torch.zeros(1, 3, height, width),),
            partial,
            input_names=["images"],
            output_names=["output"],
            dynamic_axes=free,
            opset_version=_OPSET,
            dynamo=False,
        )
    graph = onnx.load(partial)
    named = {"names": str(dict(enumerate(NAMES))), "stride": str(max(STRIDES_PX)), **about}
    del graph.metadata_props[:]
    for key, value in sorted(named.items()):
        graph.metadata_props.add(key=key, value=value)
    onnx.checker.check_model(graph)
    partial.write_bytes(graph.SerializeToString(deterministic=True))
    partial.rename(path)


def fused(network: Network) -> Network:
    """The same network with each normalisation folded into the convolution before it."""
    network = copy.deepcopy(network).eval().cpu().float()
    for block in network.modules():
        if isinstance(block, Convolution) and isinstance(block.norm, nn.BatchNorm2d):
            block.conv = _folded(block.conv, block.norm)
            block.add_module("norm", nn.Identity())
    return network


def _folded(conv: nn.Conv2d, norm: nn.BatchNorm2d) -> nn.Conv2d:
    mean, variance = norm.running_mean, norm.running_var
    assert mean is not None and variance is not None  # noqa: S101, PT018 - the network keeps both
    gain = norm.weight.detach() / (variance + norm.eps).sqrt()
    out = nn.Conv2d(
        conv.in_channels,
        conv.out_channels,
        (conv.kernel_size[0], conv.kernel_size[1]),
        (conv.stride[0], conv.stride[1]),
        (int(conv.padding[0]), int(conv.padding[1])),
    )
    assert out.bias is not None  # noqa: S101 - by default it has one
    out.weight.data = conv.weight.detach() * gain.view(-1, 1, 1, 1)
    out.bias.data = norm.bias.detach() - mean * gain
    return out


def with_all_classes(network: Network) -> Network:
    """The network with an output for each of COCO's 80 classes; those that it never learned are never found."""
    whole = copy.deepcopy(network)
    whole.numbers = 5 + len(NAMES)
    learned = [*range(5), *(5 + CLASS_IDS)]
    for index, head in enumerate(network.heads):
        assert isinstance(head, nn.Conv2d) and head.bias is not None  # noqa: S101, PT018 - the network's heads are
        wide = nn.Conv2d(head.in_channels, 3 * whole.numbers, 1)
        assert wide.bias is not None  # noqa: S101 - by default it has one
        wide.weight.data.zero_()
        wide.bias.data.fill_(_NEVER)
        wide.weight.data.view(3, whole.numbers, -1)[:, learned] = head.weight.detach().view(3, network.numbers, -1)
        wide.bias.data.view(3, whole.numbers)[:, learned] = head.bias.detach().view(3, network.numbers)
        whole.heads[index] = wide
    return whole
