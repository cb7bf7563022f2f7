"""YOLOv5 (version 6) from its published architecture: backbone, neck and three heads, in the sizes n to x."""

import math

import torch
from torch import Tensor, nn

STRIDES_PX = (8, 16, 32)
ANCHORS_PX = (
    ((10, 13), (16, 30), (33, 23)),
    ((30, 61), (62, 45), (59, 119)),
    ((116, 90), (156, 198), (373, 326)),
)
"""Width and height of the three boxes that each head starts from, fitted to COCO at 640 pixels."""
SIZES = {"n": (0.33, 0.25), "s": (0.33, 0.5), "m": (0.67, 0.75), "l": (1.0, 1.0), "x": (1.33, 1.25)}
"""Depth and width of each size, as a share of the large one's."""

# What an untrained head should say: eight objects per image of 640 pixels, and one class of about twelve.
_OBJECTS_PER_IMAGE, _IMAGE_PX, _LIKELY_CLASSES = 8, 640, 12


class Convolution(nn.Module):
    """A convolution, batch normalisation and SiLU."""

    def __init__(self, inputs: int, outputs: int, kernel: int = 1, stride: int = 1, padding: int | None = None) -> None:
        super().__init__()
        padding = kernel // 2 if padding is None else padding
        self.conv = nn.Conv2d(inputs, outputs, kernel, stride, padding, bias=False)
        self.norm = nn.BatchNorm2d(outputs, eps=1e-3, momentum=0.03)
        self.activation = nn.SiLU(inplace=True)

    def forward(self, x: Tensor) -> Tensor:
        """(B, inputs, H, W) to (B, outputs, H / stride, W / stride)."""
        out: Tensor = self.activation(self.norm(self.conv(x)))
        return out


class Bottleneck(nn.Module):
    """Two convolutions, added to what came in if `shortcut`."""

    def __init__(self, channels: int, shortcut: bool) -> None:
        super().__init__()
        self.squeeze = Convolution(channels, channels, 1)
        self.look = Convolution(channels, channels, 3)
        self.shortcut = shortcut

    def forward(self, x: Tensor) -> Tensor:
        """(B, C, H, W) to the same."""
        out: Tensor = self.look(self.squeeze(x))
        return x + out if self.shortcut else out


class CrossStage(nn.Module):
    """A cross-stage partial block of three convolutions (C3): half of the channels go through bottlenecks."""

    def __init__(self, inputs: int, outputs: int, depth: int, shortcut: bool = True) -> None:
        super().__init__()
        half = outputs // 2
        self.through = Convolution(inputs, half)
        self.past = Convolution(inputs, half)
        self.bottlenecks = nn.Sequential(*[Bottleneck(half, shortcut) for _ in range(depth)])
        self.join = Convolution(2 * half, outputs)

    def forward(self, x: Tensor) -> Tensor:
        """(B, inputs, H, W) to (B, outputs, H, W)."""
        out: Tensor = self.join(torch.cat([self.bottlenecks(self.through(x)), self.past(x)], 1))
        return out


class PyramidPooling(nn.Module):
    """Spatial pyramid pooling by one pool three times over (SPPF)."""

    def __init__(self, channels: int) -> None:
        super().__init__()
        self.squeeze = Convolution(channels, channels // 2)
        self.pool = nn.MaxPool2d(5, 1, 2)
        self.join = Convolution(channels * 2, channels)

    def forward(self, x: Tensor) -> Tensor:
        """(B, C, H, W) to the same."""
        levels = [self.squeeze(x)]
        for _ in range(3):
            levels.append(self.pool(levels[-1]))
        out: Tensor = self.join(torch.cat(levels, 1))
        return out


class Network(nn.Module):
    """The detector: images (B, 3, H, W) of 0 to 1 in RGB, H and W multiples of 32, to three heads' raw outputs."""

    anchors_px: Tensor

    def __init__(self, size: str = "n", classes: int = 80) -> None:
        super().__init__()
        depth, width = SIZES[size]

        def wide(channels: int) -> int:
            return math.ceil(channels * width / 8) * 8

        def deep(blocks: int) -> int:
            return max(round(blocks * depth), 1)

        c64, c128, c256, c512, c1024 = (wide(channels) for channels in (64, 128, 256, 512, 1024))
        self.to_p3 = nn.Sequential(
            Convolution(3, c64, 6, 2, 2),
            Convolution(c64, c128, 3, 2),
            CrossStage(c128, c128, deep(3)),
            Convolution(c128, c256, 3, 2),
            CrossStage(c256, c256, deep(6)),
        )
        self.to_p4 = nn.Sequential(Convolution(c256, c512, 3, 2), CrossStage(c512, c512, deep(9)))
        self.to_p5 = nn.Sequential(
            Convolution(c512, c1024, 3, 2), CrossStage(c1024, c1024, deep(3)), PyramidPooling(c1024)
        )
        self.up = nn.Upsample(scale_factor=2, mode="nearest")
        self.narrow_p5 = Convolution(c1024, c512)
        self.down_p4 = CrossStage(c1024, c512, deep(3), shortcut=False)
        self.narrow_p4 = Convolution(c512, c256)
        self.out_p3 = CrossStage(c512, c256, deep(3), shortcut=False)
        self.shrink_p3 = Convolution(c256, c256, 3, 2)
        self.out_p4 = CrossStage(c512, c512, deep(3), shortcut=False)
        self.shrink_p4 = Convolution(c512, c512, 3, 2)
        self.out_p5 = CrossStage(c1024, c1024, deep(3), shortcut=False)
        self.numbers = classes + 5
        self.heads = nn.ModuleList(nn.Conv2d(channels, 3 * self.numbers, 1) for channels in (c256, c512, c1024))
        self.register_buffer("anchors_px", torch.tensor(ANCHORS_PX, dtype=torch.float32), persistent=False)
        self._expect_little()

    def _expect_little(self) -> None:
        """Biases that make an untrained head's scores as rare as objects are."""
        for head, stride in zip(self.heads, STRIDES_PX, strict=True):
            assert isinstance(head, nn.Conv2d) and head.bias is not None  # noqa: S101, PT018 - made above
            bias = head.bias.detach().view(3, -1)
            bias[:, 4] += math.log(_OBJECTS_PER_IMAGE / (_IMAGE_PX / stride) ** 2)
            bias[:, 5:] += math.log(0.6 / (_LIKELY_CLASSES - 1))

    def forward(self, images: Tensor) -> list[Tensor]:
        """Per head (B, 3, h, w, 5 + classes): x, y, width, height, object, classes, all before the sigmoid."""
        p3 = self.to_p3(images)
        p4 = self.to_p4(p3)
        top = self.narrow_p5(self.to_p5(p4))
        middle = self.narrow_p4(self.down_p4(torch.cat([self.up(top), p4], 1)))
        out3 = self.out_p3(torch.cat([self.up(middle), p3], 1))
        out4 = self.out_p4(torch.cat([self.shrink_p3(out3), middle], 1))
        out5 = self.out_p5(torch.cat([self.shrink_p4(out4), top], 1))
        return [
            head(out).view(out.shape[0], 3, self.numbers, *out.shape[2:]).permute(0, 1, 3, 4, 2)
            for head, out in zip(self.heads, (out3, out4, out5), strict=True)
        ]

    def decode(self, raw: list[Tensor]) -> Tensor:
        """The heads' outputs as rows (B, N, 5 + classes): centre x, y, width, height in pixels, then probabilities."""
        rows = []
        for head, (out, stride) in enumerate(zip(raw, STRIDES_PX, strict=True)):
            batch, _, height, width, numbers = out.shape
            share = out.sigmoid()
            y, x = torch.meshgrid(
                torch.arange(height, device=out.device), torch.arange(width, device=out.device), indexing="ij"
            )
            corner = torch.stack([x, y], -1).to(out.dtype) - 0.5
            centre = (share[..., :2] * 2 + corner) * stride
            size = (share[..., 2:4] * 2) ** 2 * self.anchors_px[head].view(1, 3, 1, 1, 2)
            rows.append(torch.cat([centre, size, share[..., 4:]], -1).view(batch, -1, numbers))
        return torch.cat(rows, 1)


class Decoded(nn.Module):
    """A network that gives decoded rows (B, N, 5 + classes), as exports do."""

    def __init__(self, network: Network) -> None:
        super().__init__()
        self.network = network

    def forward(self, images: Tensor) -> Tensor:
        """See `Network.decode`."""
        return self.network.decode(self.network(images))
