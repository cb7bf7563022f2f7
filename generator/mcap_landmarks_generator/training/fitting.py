"""Training itself: steps over examples, a moving average of the weights, checkpoints to go on from."""

import copy
import math
import time
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from pathlib import Path

import torch
from torch import Tensor
from torch.utils.data import DataLoader

from mcap_landmarks_generator.training.examples import CLASS_IDS, Batch, Examples, Phase
from mcap_landmarks_generator.training.loss import loss
from mcap_landmarks_generator.training.network import Network

LAST = "last.pt"


@dataclass(frozen=True, slots=True)
class Recipe:
    """How to train: the phases, and the usual numbers of AdamW with a cosine's decay."""

    phases: tuple[Phase, ...]
    seed: int = 0
    learning_rate: float = 3e-3
    weight_decay: float = 0.02
    warm_up_steps: int = 200
    average_over_steps: int = 1000
    clip_norm: float = 10.0
    half: bool = True
    """Whether sums are in bfloat16 where that does: much faster on GPUs and on CPUs with AMX, slower on others."""


@dataclass(frozen=True, slots=True)
class Progress:
    """Where a training is: steps done, examples per second of this call, and the mean losses since the last report."""

    step: int
    steps: int
    per_second: float
    box: float
    object: float
    classes: float


@dataclass(slots=True)
class Training:
    """What changes while training: the network, its moving average, the optimizer and the steps done."""

    network: Network
    average: Network
    optimizer: torch.optim.AdamW
    step: int = 0
    seconds: float = 0.0

    def save(self, path: Path, recipe: Recipe) -> None:
        """Write a checkpoint, whole or not at all."""
        state = {
            "network": self.network.state_dict(),
            "average": self.average.state_dict(),
            "optimizer": self.optimizer.state_dict(),
            "step": self.step,
            "seconds": self.seconds,
            "recipe": asdict(recipe),
        }
        partial = path.with_suffix(".part")
        torch.save(state, partial)
        partial.rename(path)


def start(
    recipe: Recipe, device: torch.device, checkpoint: Path | None = None, before: Network | None = None
) -> Training:
    """A training from scratch, from what a network has learned `before`, or from where a checkpoint left it."""
    torch.manual_seed(recipe.seed)
    fresh = Network("n", len(CLASS_IDS)) if before is None else before
    network = fresh.to(device, memory_format=torch.channels_last)  # type: ignore[call-overload]
    average = copy.deepcopy(network).eval().requires_grad_(False)
    decayed = [weight for weight in network.parameters() if weight.ndim > 1]
    others = [weight for weight in network.parameters() if weight.ndim <= 1]
    groups = [{"params": decayed, "weight_decay": recipe.weight_decay}, {"params": others, "weight_decay": 0.0}]
    training = Training(network, average, torch.optim.AdamW(groups, lr=recipe.learning_rate, betas=(0.9, 0.99)))
    if checkpoint is not None:
        state = torch.load(checkpoint, map_location=device, weights_only=True)
        network.load_state_dict(state["network"])
        average.load_state_dict(state["average"])
        training.optimizer.load_state_dict(state["optimizer"])
        training.step, training.seconds = state["step"], state["seconds"]
    return training


@dataclass(frozen=True, slots=True)
class Trained:
    """The averaged network of a checkpoint, with the steps, seconds and recipe that made it."""

    network: Network
    step: int
    seconds: float
    recipe: Recipe


def trained(checkpoint: Path, device: torch.device) -> Trained:
    """What a checkpoint holds, ready to detect."""
    state = torch.load(checkpoint, map_location=device, weights_only=True)
    network = Network("n", len(CLASS_IDS)).to(device)
    network.load_state_dict(state["average"])
    phases = tuple(Phase(**phase) for phase in state["recipe"].pop("phases"))
    return Trained(network.eval(), state["step"], state["seconds"], Recipe(phases, **state["recipe"]))


def fit(
    training: Training,
    recipe: Recipe,
    examples: Examples,
    folder: Path,
    report_every: int = 50,
    save_every: int = 200,
    beside: bool = True,
) -> Iterator[Progress]:
    """Train to the end of the recipe; checkpoints go to the folder. `beside`: another process makes the examples."""
    network, device = training.network.train(), next(training.network.parameters()).device
    steps = len(examples)
    began, done, seconds_before = time.monotonic(), 0, training.seconds
    sums = [0.0, 0.0, 0.0]
    loader: DataLoader[Batch] = DataLoader(
        examples,  # type: ignore[arg-type]
        batch_size=None,
        sampler=range(training.step, steps),
        collate_fn=_as_it_is,
        num_workers=int(beside),
        prefetch_factor=4 if beside else None,
        multiprocessing_context="spawn" if beside else None,
    )
    for batch in loader:
        images = torch.from_numpy(batch.images).to(device).permute(0, 3, 1, 2).float() / 255
        for group in training.optimizer.param_groups:
            group["lr"] = recipe.learning_rate * _pace(training.step, steps, recipe.warm_up_steps)
        with torch.autocast(device.type, torch.bfloat16, enabled=recipe.half):
            raw = network(images.contiguous(memory_format=torch.channels_last))
        losses = loss(raw, torch.from_numpy(batch.targets).to(device), network.anchors_px)
        training.optimizer.zero_grad(set_to_none=True)
        losses.total.backward()  # type: ignore[no-untyped-call]
        torch.nn.utils.clip_grad_norm_(network.parameters(), recipe.clip_norm)
        training.optimizer.step()
        training.step += 1
        _average(training, recipe.average_over_steps)
        done += len(batch.images)
        sums = [a + b for a, b in zip(sums, losses[1:], strict=True)]
        training.seconds = seconds_before + time.monotonic() - began
        if training.step % save_every == 0 or training.step == steps:
            training.save(folder / LAST, recipe)
        if training.step % report_every == 0 or training.step == steps:
            mean = [value / report_every for value in sums]
            yield Progress(training.step, steps, done / (time.monotonic() - began), *mean)
            sums = [0.0, 0.0, 0.0]


def _as_it_is(batch: object) -> object:
    return batch


def _pace(step: int, steps: int, warm_up: int) -> float:
    """Share of the learning rate: up in a line, down in a cosine to a hundredth."""
    return min(1.0, (step + 1) / warm_up) * (0.01 + 0.99 * 0.5 * (1 + math.cos(math.pi * step / steps)))


@torch.no_grad()
def _average(training: Training, over_steps: int) -> None:
    """Move the average towards the network, faster at first."""
    keep = (1 - 1 / over_steps) * (1 - math.exp(-training.step / (over_steps / 3)))
    averaged: dict[str, Tensor] = training.average.state_dict()
    for name, value in training.network.state_dict().items():
        if value.dtype.is_floating_point:
            averaged[name].lerp_(value, 1 - keep)
        else:
            averaged[name].copy_(value)
