"""Lines of text in pictures, in the letters that plots have."""

from functools import lru_cache
from pathlib import Path

import matplotlib as mpl
import numpy as np
from PIL import Image, ImageDraw, ImageFont

from mcap_landmarks.vision.pixels import Rgb

Colour = tuple[int, int, int]
INK, FAINT, PAPER = (17, 24, 39), (107, 114, 128), (255, 255, 255)
_MORE = " ..."


@lru_cache(maxsize=16)
def font(size_px: int, *, bold: bool = False) -> ImageFont.FreeTypeFont:
    """DejaVu Sans, which matplotlib brings along: the same on every machine."""
    name = "DejaVuSans-Bold.ttf" if bold else "DejaVuSans.ttf"
    return ImageFont.truetype(str(Path(mpl.get_data_path()) / "fonts" / "ttf" / name), size_px)


def write_lines(
    size: tuple[int, int], lines: list[tuple[str, int, Colour, bool]], badge: tuple[str, Colour] | None = None
) -> Rgb:
    """A picture of W, H pixels with lines of text, each with its size, colour, and whether it is bold.

    A badge stands above them, white on its colour.
    """
    picture = Image.new("RGB", size, PAPER)
    draw = ImageDraw.Draw(picture)
    left, top = max(size[0] // 40, 8), max(size[1] // 20, 6)
    if badge is not None:
        letters = font(max(round(size[1] * 0.13), 11), bold=True)
        ascent, descent = letters.getmetrics()
        room = ascent // 2
        right, below = left + round(letters.getlength(badge[0])) + 2 * room, top + ascent + 2 * descent
        draw.rounded_rectangle((left, top, right, below), room, fill=badge[1])
        draw.text((left + room, top + descent // 2), badge[0], font=letters, fill=PAPER)
        top = below + room
    for text, size_px, colour, bold in lines:
        letters = font(size_px, bold=bold)
        draw.text((left, top), _cut(text, letters, size[0] - 2 * left), font=letters, fill=colour)
        top += round(size_px * 1.45)
    return np.asarray(picture, dtype=np.uint8)


def _cut(text: str, letters: ImageFont.FreeTypeFont, width: int) -> str:
    """As much of a text as there is room for."""
    if letters.getlength(text) <= width:
        return text
    while text and letters.getlength(text + _MORE) > width:
        text = text[:-1]
    return text.rstrip(" ,") + _MORE
