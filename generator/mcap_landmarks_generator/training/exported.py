"""An exported network, read back so that it can go on learning."""

from collections.abc import Iterator
from pathlib import Path

import onnx
import torch
from torch import Tensor, nn

from mcap_landmarks_generator.training.examples import CLASS_IDS, Examples
from mcap_landmarks_generator.training.network import Convolution, Network

_PREFIX = "network."
# So many batches tell what a layer's outputs are like.
_CALIBRATION_STEPS = 8


def read(path: Path) -> Network:
    """The network that `export.export` wrote; in evaluation it says the same, its normalisations do nothing.

    Raises:
        KeyError: the file is not an export of this network.
    """
    stored = {one.name: torch.tensor(onnx.numpy_helper.to_array(one)) for one in onnx.load(path).graph.initializer}
    network = Network("n", len(CLASS_IDS))
    network.eval()
    network.requires_grad_(False)
    for name, block in _convolutions(network):
        block.conv.weight.copy_(stored[f"{_PREFIX}{name}.conv.weight"])
        block.norm.bias.copy_(stored[f"{_PREFIX}{name}.conv.bias"])
        block.norm.weight.fill_((1 + block.norm.eps) ** 0.5)
    learned = [*range(5), *(5 + CLASS_IDS)]
    for index, head in enumerate(network.heads):
        assert isinstance(head, nn.Conv2d) and head.bias is not None  # noqa: S101, PT018 - the network's heads are
        for own, what in ((head.weight, "weight"), (head.bias, "bias")):
            wide = stored[f"{_PREFIX}heads.{index}.{what}"]
            own.copy_(wide.view(3, -1, *wide.shape[1:])[:, learned].reshape(own.shape))
    network.requires_grad_(True)
    return network


def _convolutions(network: Network) -> Iterator[tuple[str, Convolution]]:
    return ((name, block) for name, block in network.named_modules() if isinstance(block, Convolution))


@torch.no_grad()
def calibrate(network: Network, examples: Examples) -> None:
    """Give the normalisations the statistics of examples, in place; in evaluation the network goes on saying the same.

    An export has none: they are folded into its convolutions, and training would begin with others.
    """
    sums: dict[str, list[Tensor]] = {name: [] for name, _ in _convolutions(network)}
    hooks = [
        block.conv.register_forward_hook(lambda _, __, out, kept=sums[name]: kept.append(_moments(out)))
        for name, block in _convolutions(network)
    ]
    for step in range(min(_CALIBRATION_STEPS, len(examples))):
        network(torch.from_numpy(examples[step].images).permute(0, 3, 1, 2).float() / 255)
    for hook in hooks:
        hook.remove()
    for name, block in _convolutions(network):
        mean, square = torch.stack(sums[name]).mean(dim=0)
        norm = block.norm
        assert norm.running_mean is not None and norm.running_var is not None  # noqa: S101, PT018 - it keeps both
        scale = norm.weight / (norm.running_var + norm.eps).sqrt()
        norm.bias.add_(scale * (mean - norm.running_mean))
        norm.running_mean.copy_(mean)
        norm.running_var.copy_(square - mean**2)
        norm.weight.copy_(scale * (norm.running_var + norm.eps).sqrt())


def _moments(out: Tensor) -> Tensor:
    """Mean and mean square (2, C) of a layer's outputs (B, C, H, W)."""
    return torch.stack([out.mean(dim=(0, 2, 3)), out.square().mean(dim=(0, 2, 3))])
