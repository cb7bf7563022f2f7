"""What training minimises: boxes by complete IoU, objectness and classes by cross entropy, anchors matched by shape."""

from typing import NamedTuple

import torch
from torch import Tensor
from torch.nn.functional import binary_cross_entropy_with_logits as cross_entropy

from mcap_landmarks_generator.training.network import STRIDES_PX

# A target belongs to an anchor if neither side is this many times longer than the other's.
_SHAPE_RATIO = 4.0
# The finest head has most cells, and most of them are empty.
_HEAD_BALANCE = (4.0, 1.0, 0.4)
_BOX, _OBJECT, _CLASS = 0.25, 1.0, 0.25
_EPSILON = 1e-7


class Losses(NamedTuple):
    """The sum to minimise, and its parts before their weights."""

    total: Tensor
    box: float
    object: float
    classes: float


def loss(raw: list[Tensor], targets: Tensor, anchors_px: Tensor) -> Losses:
    """The loss of three heads' raw outputs (B, 3, h, w, 5 + classes).

    Targets (N, 6): image, class, centre x and y, width and height in pixels. anchors_px (3, 3, 2).
    """
    box = object_ = classes = torch.zeros((), device=targets.device)
    for head, (out, stride) in enumerate(zip(raw, STRIDES_PX, strict=True)):
        wanted = torch.zeros(out.shape[:4], device=out.device)
        cells = _cells(targets, anchors_px[head] / stride, stride, (out.shape[2], out.shape[3]))
        if len(cells.target):
            said = out[cells.image, cells.anchor, cells.row, cells.column].float()
            centre = said[:, :2].sigmoid() * 2 - 0.5
            size = (said[:, 2:4].sigmoid() * 2) ** 2 * (anchors_px[head] / stride)[cells.anchor]
            overlap = complete_iou(torch.cat([centre, size], 1), cells.box)
            box = box + (1 - overlap).mean()
            score = overlap.detach().clamp(0)
            order = score.argsort()  # where two targets share a cell, the better one decides
            places = cells.image[order], cells.anchor[order], cells.row[order], cells.column[order]
            wanted[places] = score[order]
            is_class = torch.zeros_like(said[:, 5:])
            is_class[torch.arange(len(said), device=said.device), targets[cells.target, 1].long()] = 1
            classes = classes + cross_entropy(said[:, 5:], is_class)
        object_ = object_ + cross_entropy(out[..., 4].float(), wanted) * _HEAD_BALANCE[head]
    total = _BOX * box + _OBJECT * object_ + _CLASS * classes
    return Losses(total, *(float(part.detach()) for part in (box, object_, classes)))


class _Cells(NamedTuple):
    """Where a head should find targets: image, anchor, row, column and target (M,); boxes (M, 4) seen from there."""

    image: Tensor
    anchor: Tensor
    row: Tensor
    column: Tensor
    target: Tensor
    box: Tensor


def _cells(targets: Tensor, anchors: Tensor, stride: int, size: tuple[int, int]) -> _Cells:
    """The cells (rows, columns of `size`) for each target: its own, and the nearest one beside and above or below."""
    boxes = targets[:, 2:6] / stride
    ratio = boxes[None, :, 2:] / anchors[:, None]
    fits = torch.max(ratio, 1 / ratio).amax(2) < _SHAPE_RATIO
    anchor, target = fits.nonzero(as_tuple=True)
    centre = boxes[target, :2]
    limit = torch.tensor([size[1], size[0]], device=targets.device, dtype=boxes.dtype)
    nearer_low = (centre % 1 < 0.5) & (centre > 1)
    nearer_high = (centre % 1 > 0.5) & (centre < limit - 1)
    own = torch.ones_like(nearer_low[:, 0])
    chosen = torch.stack([own, nearer_low[:, 0], nearer_low[:, 1], nearer_high[:, 0], nearer_high[:, 1]])
    steps = torch.tensor([[0, 0], [-1, 0], [0, -1], [1, 0], [0, 1]], device=targets.device)
    step, pair = chosen.nonzero(as_tuple=True)
    anchor, target = anchor[pair], target[pair]
    cell = boxes[target, :2].long() + steps[step]
    cell = torch.minimum(cell.clamp(min=0), limit.long() - 1)
    seen = torch.cat([boxes[target, :2] - cell, boxes[target, 2:]], 1)
    return _Cells(targets[target, 0].long(), anchor, cell[:, 1], cell[:, 0], target, seen)


def complete_iou(a: Tensor, b: Tensor) -> Tensor:
    """Complete IoU (N,) of boxes (N, 4), centre and size each (Zheng et al. 2020)."""
    low_a, high_a, low_b, high_b = (
        corner for box in (a, b) for corner in (box[:, :2] - box[:, 2:] / 2, box[:, :2] + box[:, 2:] / 2)
    )
    shared = (torch.minimum(high_a, high_b) - torch.maximum(low_a, low_b)).clamp(0).prod(1)
    iou = shared / (a[:, 2:].prod(1) + b[:, 2:].prod(1) - shared + _EPSILON)
    diagonal = (torch.maximum(high_a, high_b) - torch.minimum(low_a, low_b)).square().sum(1) + _EPSILON
    apart = (a[:, :2] - b[:, :2]).square().sum(1)
    slant_a, slant_b = torch.atan(a[:, 2] / (a[:, 3] + _EPSILON)), torch.atan(b[:, 2] / (b[:, 3] + _EPSILON))
    shape = 4 / torch.pi**2 * (slant_b - slant_a).square()
    with torch.no_grad():
        weight = shape / (shape - iou + 1 + _EPSILON)
    return iou - apart / diagonal - weight * shape
