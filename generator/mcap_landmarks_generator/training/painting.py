"""Brushes for painted pictures: skies, grounds, trees, hedges, houses, fences, poles and shapes on a canvas."""

import cv2
import numpy as np
from numpy.typing import ArrayLike, NDArray

from mcap_landmarks_generator.assets.texture import Colour, grey, hsv, noise, pick, vivid

Rng = np.random.Generator
Canvas = NDArray[np.uint8]

HEIGHT_PX, WIDTH_PX = 480, 640
# Of a branch: how much shorter its children are, how thick it may be at the least, and how many leaves a twig bears.
_SHORTER, _THINNEST_PX, _LEAVES = (0.6, 0.88), 1, (6, 40)
_MOST_LEAVES = 1800
_DEEPEST = 6


def smooth(rng: Rng, fewest: int, most: int) -> NDArray[np.float64]:
    """Smooth noise of 0 to 1 over the canvas (H, W), of so many blobs across."""
    half = noise(rng, WIDTH_PX // 2, WIDTH_PX // 2, octaves=5, cells=int(rng.integers(fewest, most)))[: HEIGHT_PX // 2]
    return np.asarray(cv2.resize(half, (WIDTH_PX, HEIGHT_PX), interpolation=cv2.INTER_CUBIC), float)


def cloudy(rng: Rng) -> Canvas:
    """A canvas of noise that leads from one colour to another, with grain."""
    first, second = palette(rng, 2)
    blend = smooth(rng, 1, 40)[..., None]
    grain = rng.normal(0, rng.uniform(0, 25), (HEIGHT_PX, WIDTH_PX, 1))
    return _pixels(first + (second - first) * blend + grain)


def palette(rng: Rng, count: int) -> list[Colour]:
    """So many colours: greens, browns, greys and a few vivid ones."""
    makers = (
        lambda: hsv(rng.uniform(0.15, 0.38), rng.uniform(0.2, 0.8), rng.uniform(0.1, 0.7)),
        lambda: hsv(rng.uniform(0.03, 0.13), rng.uniform(0.1, 0.7), rng.uniform(0.1, 0.8)),
        lambda: grey(rng, 0.05, 1.0),
        lambda: vivid(rng, 0.2),
    )
    return [makers[rng.choice(4, p=(0.27, 0.25, 0.44, 0.04))]() for _ in range(count)]


def sky(rng: Rng) -> Canvas:
    """A sky, blue, clouded or burnt out."""
    top = pick(rng, (hsv(rng.uniform(0.54, 0.62), rng.uniform(0.2, 0.7), rng.uniform(0.6, 1)), grey(rng, 0.5, 1.0)))
    low = top + (255 - top) * rng.uniform(0, 1)
    share = np.linspace(0, 1, HEIGHT_PX)[:, None, None]
    clouds = np.clip(smooth(rng, 1, 5) * 2 - rng.uniform(0.6, 2.0), 0, 1)[..., None]
    blue = top + (low - top) * share
    return _pixels(blue + (250 - blue) * clouds)


def ground(canvas: Canvas, horizon: int, rng: Rng) -> None:
    """Ground below the horizon: finer with distance, perhaps with a lighter road and marks on it."""
    rows = np.arange(horizon, HEIGHT_PX)
    depth = 1.0 / (rows - horizon + 4.0)
    pattern = noise(rng, 512, 512, octaves=5, cells=int(rng.integers(2, 20))).astype(np.float32)
    across = (np.arange(WIDTH_PX) - WIDTH_PX / 2)[None, :] * depth[:, None] * 300
    along = np.broadcast_to(9000 * depth[:, None], across.shape)
    columns, rows_of = (np.mod(axis, 511).astype(np.float32) for axis in (across, along))
    shade = cv2.remap(pattern, columns, rows_of, cv2.INTER_LINEAR)[..., None]
    colour = palette(rng, 1)[0]
    canvas[horizon:] = _pixels(colour * (0.75 + rng.uniform(0.1, 0.7) * shade))
    middle = rng.uniform(0, WIDTH_PX)
    for _ in range(rng.integers(0, 4)):
        feet = middle + rng.uniform(-1.5, 1.5) * WIDTH_PX + np.array([0, rng.uniform(5, 400)])
        corners = [[middle, horizon], [feet[1], HEIGHT_PX], [feet[0], HEIGHT_PX]]
        _fill(canvas, corners, palette(rng, 1)[0])


def dapple(canvas: Canvas, rng: Rng) -> None:
    """Shadows of leaves, or of a house, over a part of everything, in place."""
    shadow = smooth(rng, 2, 60) + rng.uniform(0.2, 1.5) * (smooth(rng, 1, 2) - 0.5) > rng.uniform(0.3, 0.7)
    soft = cv2.GaussianBlur(shadow.astype(np.float32), (0, 0), rng.uniform(0.5, 3))[..., None]
    canvas[:] = _pixels(canvas * (1 - rng.uniform(0.2, 0.7) * soft))


def tree(canvas: Canvas, foot: tuple[float, float], height_px: float, rng: Rng) -> None:
    """A tree: a trunk that branches down to twigs, bare or with leaves that are darker inside and below."""
    bark = hsv(rng.uniform(0.03, 0.12), rng.uniform(0.05, 0.5), rng.uniform(0.05, 0.5))
    trunk = height_px * rng.uniform(0.2, 0.4)
    lines: list[tuple[NDArray[np.float64], NDArray[np.float64], float]] = []
    spread = rng.uniform(0.25, 0.7)
    start = np.array(foot, float)
    _branch(lines, start, -np.pi / 2 + rng.normal(0, 0.06), trunk, (height_px * rng.uniform(0.02, 0.06), spread), rng)
    twigs = np.array([end for _, end, width in lines if width < height_px * 0.02]).reshape(-1, 2)
    bare = rng.random() < 0.15
    if not bare:
        leaves(canvas, twigs, height_px * rng.uniform(0.03, 0.1), 0.75, rng)
    for begin, end, width in lines:
        shade = bark * rng.uniform(0.7, 1.3)
        _line(canvas, (begin, end), width, shade)
    if not bare:
        leaves(canvas, twigs[rng.random(len(twigs)) < rng.uniform(0.3, 1)], height_px * 0.05, 1.0, rng)


def _branch(
    lines: list[tuple[NDArray[np.float64], NDArray[np.float64], float]],
    start: NDArray[np.float64],
    angle: float,
    length: float,
    habit: tuple[float, float],
    rng: Rng,
    deep: int = 0,
) -> None:
    """Add a branch and all that grows on it; `habit` are its width in pixels and how far children spread."""
    width, spread = habit
    end = start + length * np.array([np.cos(angle), np.sin(angle)])
    lines.append((start, end, width))
    if deep >= _DEEPEST or length < 3:
        return
    for _ in range(rng.integers(2, 4)):
        turn = angle + rng.normal(0, spread)
        shorter = length * rng.uniform(*_SHORTER)
        _branch(lines, end, turn, shorter, (width * rng.uniform(0.5, 0.75), spread), rng, deep + 1)


def leaves(canvas: Canvas, places: NDArray[np.float64], reach_px: float, light: float, rng: Rng) -> None:
    """Leaves about places (N, 2): small ellipses of all directions in shades of one colour."""
    if not len(places):
        return
    autumn = rng.random() < 0.12
    colour = hsv(
        rng.uniform(0.02, 0.13) if autumn else rng.uniform(0.17, 0.36), rng.uniform(0.2, 0.8), rng.uniform(0.15, 0.6)
    )
    many = min(_MOST_LEAVES, len(places) * int(rng.integers(*_LEAVES)))
    at = places[rng.integers(len(places), size=many)] + rng.normal(0, reach_px, (many, 2))
    size = max(1.0, reach_px * rng.uniform(0.08, 0.35)) * (_MOST_LEAVES / many) ** 0.25
    axes = round(size * 16), round(size * rng.uniform(0.4, 0.9) * 16)
    high = (at[:, 1] - at[:, 1].min()) / max(np.ptp(at[:, 1]), 1.0)
    shade = light * (1.25 - 0.6 * high) * rng.uniform(0.4, 1.6, many)
    tones = np.clip(colour * shade[:, None] * rng.uniform(0.85, 1.15, (many, 3)), 0, 255).tolist()
    turns = rng.uniform(0, 180, many).tolist()
    for centre, tone, turn in zip(np.rint(at * 16).astype(int).tolist(), tones, turns, strict=True):
        cv2.ellipse(canvas, centre, axes, turn, 0, 360, tone, -1, cv2.LINE_AA, 4)


def hedge(canvas: Canvas, foot: tuple[float, float], width_px: float, height_px: float, rng: Rng) -> None:
    """A hedge, or a bush: leaves without a trunk."""
    count = int(np.clip(width_px * height_px / 60, 8, 250))
    x = foot[0] + rng.uniform(-0.5, 0.5, count) * width_px
    y = foot[1] - rng.uniform(0, 1, count) ** 0.7 * height_px
    leaves(canvas, np.column_stack([x, y]), max(2.0, 0.12 * height_px), 0.8, rng)


def facade(rng: Rng) -> Canvas:
    """A wall (256, 512, 3) with courses of brick or boards, storeys of windows, a roof, doors and letters."""
    wall = palette(rng, 1)[0]
    shade = 0.85 + 0.3 * noise(rng, 256, 256, octaves=5, cells=4).repeat(2, axis=1)[..., None]
    picture = _pixels(wall * shade)
    courses = int(rng.integers(0, 60))
    for row in np.linspace(0, 256, courses, endpoint=False):
        cv2.line(picture, (0, int(row)), (511, int(row)), _tone(wall * 0.75), 1)
    storeys, bays = int(rng.integers(1, 6)), int(rng.integers(2, 14))
    high, wide = rng.uniform(0.3, 0.8), rng.uniform(0.2, 0.85)
    pane, frame = pick(rng, (grey(rng, 0.05, 0.4), hsv(0.57, 0.3, 0.6))), grey(rng, 0.3, 1.0)
    for storey in range(storeys):
        for bay in range(bays):
            left, top = int((bay + 0.5 - wide / 2) * 512 / bays), int((storey + 0.5 - high / 2) * 256 / storeys)
            right, bottom = int(left + wide * 512 / bays), int(top + high * 256 / storeys)
            cv2.rectangle(picture, (left, top), (right, bottom), _tone(pane * rng.uniform(0.5, 1.4)), -1)
            cv2.rectangle(picture, (left, top), (right, bottom), _tone(frame), int(rng.integers(1, 4)))
            if rng.random() < 0.6:
                cv2.line(picture, ((left + right) // 2, top), ((left + right) // 2, bottom), _tone(frame), 2)
    if rng.random() < 0.6:
        cv2.rectangle(picture, (0, 0), (511, int(rng.uniform(5, 70))), _tone(palette(rng, 1)[0]), -1)
    for _ in range(rng.integers(0, 4)):
        place = (int(rng.uniform(0, 400)), int(rng.uniform(30, 250)))
        text = "".join(chr(code) for code in rng.integers(65, 91, rng.integers(3, 9)))
        cv2.putText(picture, text, place, int(rng.integers(0, 8)), rng.uniform(0.4, 2.5), _tone(palette(rng, 1)[0]), 3)
    return picture


def row_of_houses(canvas: Canvas, vanishing: tuple[float, float], side: int, rng: Rng) -> None:
    """Houses along a road to one side (-1 left, 1 right), drawn together to the point where it vanishes."""
    x, y = vanishing
    edge = rng.uniform(0.1, 0.6) * WIDTH_PX
    near = 1.0
    pieces: list[tuple[float, float, float, float]] = []
    while near > 0.04 and len(pieces) < 6:
        far = near * rng.uniform(0.3, 0.8)
        pieces.append((near, far, rng.uniform(0.2, 1.3) * HEIGHT_PX, rng.uniform(0.05, 0.4) * HEIGHT_PX))
        near = far * rng.uniform(0.7, 1.0)
    for near, far, high, low in reversed(pieces):
        corners = [
            [x + side * edge * share * 2.2, y + drop * share]
            for share, drop in ((near, -high), (far, -high), (far, low), (near, low))
        ]
        lay(canvas, facade(rng), corners)


def lay(canvas: Canvas, picture: Canvas, corners: ArrayLike) -> None:
    """Lay a picture on four corners (4, 2) in pixels, in place."""
    height, width = picture.shape[:2]
    source = np.array([[0, 0], [width, 0], [width, height], [0, height]], np.float32)
    matrix = cv2.getPerspectiveTransform(source, np.asarray(corners, np.float32))
    size = (WIDTH_PX, HEIGHT_PX)
    laid = cv2.warpPerspective(picture, matrix, size, flags=cv2.INTER_AREA)
    cover = cv2.warpPerspective(np.full(picture.shape[:2], 255, np.uint8), matrix, size)
    canvas[cover > 127] = laid[cover > 127]


def fence(canvas: Canvas, foot: tuple[float, float], width_px: float, height_px: float, rng: Rng) -> None:
    """Bars or boards between rails, or a mesh, nearer at one end than at the other."""
    colour = pick(rng, (grey(rng, 0.02, 0.3), grey(rng, 0.6, 1.0), *palette(rng, 1)))
    slant = rng.uniform(-0.5, 0.5, 2)
    bars = int(rng.integers(4, 60))
    place = np.linspace(0, 1, bars) ** rng.uniform(0.6, 1.6)
    low = np.column_stack([foot[0] + width_px * place, foot[1] + width_px * slant[0] * place])
    high = low - np.array([0, height_px])[None, :] * (1 + slant[1] * place[:, None])
    thick = max(1.0, width_px / bars * rng.uniform(0.05, 0.5))
    for begin, end in zip(low, high, strict=True):
        _line(canvas, (begin, end), thick, colour * rng.uniform(0.85, 1.15))
    for share in rng.uniform(0, 1, rng.integers(1, 4)):
        rail = low + share * (high - low)
        _line(canvas, (rail[0], rail[-1]), thick * 1.3, colour)
    if rng.random() < 0.25:
        for begin, end in zip(low[:-1], high[1:], strict=True):
            _line(canvas, (begin, end), 1, colour)


def pole(canvas: Canvas, foot: tuple[float, float], height_px: float, rng: Rng) -> None:
    """A pole with an arm, a lamp, a board or wires."""
    colour, width = grey(rng, 0.05, 0.8), max(1.0, height_px * rng.uniform(0.008, 0.04))
    base = np.array(foot, float)
    top = base - [rng.normal(0, 0.02) * height_px, height_px]
    _line(canvas, (base, top), width, colour)
    for _ in range(rng.integers(0, 4)):
        kind, reach = rng.integers(3), height_px * rng.uniform(0.1, 0.5) * rng.choice((-1, 1))
        at = base + rng.uniform(0.5, 1) * (top - base)
        if kind == 0:
            _line(canvas, (at, at + np.array([reach, -abs(reach) * rng.uniform(0, 0.5)])), width * 0.7, colour)
        elif kind == 1:
            size = height_px * rng.uniform(0.04, 0.2, 2)
            board = at + np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) * size / 2
            _fill(canvas, board, palette(rng, 1)[0])
        else:
            sag = np.linspace(-1, 1, 20)
            wire = at + np.column_stack([(sag + 1) * 6 * reach, (1 - sag**2) * abs(reach) * 0.4])
            cv2.polylines(canvas, [np.rint(wire).astype(np.int32)], False, _tone(colour * 0.5), 1, cv2.LINE_AA)


def shape(canvas: Canvas, place: ArrayLike, size_px: float, colours: list[Colour], rng: Rng) -> None:
    """One leaf, stone, board or stalk of a size, in one of the colours, with an edge of its own at times."""
    colour = colours[rng.integers(len(colours))] * rng.uniform(0.5, 1.5)
    centre = np.asarray(place, float)
    kind = rng.integers(4)
    if kind == 0:
        corners = np.sort(rng.uniform(0, 2 * np.pi, rng.integers(3, 8)))
    else:
        corners = np.linspace(0, 2 * np.pi, 24, endpoint=False)
    outline = np.column_stack([np.cos(corners), np.sin(corners)])
    outline *= size_px * np.array([1.0, (1.0, 0.6, 0.35, 0.08)[kind] * rng.uniform(0.5, 1.2)])
    turn = rng.uniform(0, np.pi)
    c, s = np.cos(turn), np.sin(turn)
    outline = centre + outline @ np.array([[c, s], [-s, c]])
    _fill(canvas, outline, colour)
    if rng.random() < 0.3:
        cv2.polylines(canvas, [np.rint(outline).astype(np.int32)], True, _tone(colour * 0.5), 1, cv2.LINE_AA)


def _line(canvas: Canvas, ends: tuple[NDArray[np.float64], NDArray[np.float64]], width: float, colour: Colour) -> None:
    points = [tuple(round(float(value) * 16) for value in end) for end in ends]
    cv2.line(canvas, points[0], points[1], _tone(colour), max(_THINNEST_PX, round(width)), cv2.LINE_AA, 4)


def _fill(canvas: Canvas, corners: ArrayLike, colour: Colour) -> None:
    cv2.fillPoly(canvas, [np.rint(np.asarray(corners) * 16).astype(np.int32)], _tone(colour), cv2.LINE_AA, 4)


def _tone(colour: Colour) -> list[float]:
    return [float(value) for value in np.clip(colour, 0, 255)]


def _pixels(values: NDArray[np.floating]) -> Canvas:
    return np.asarray(np.clip(values, 0, 255), np.uint8)
