"""Beams of a LiDAR that never return anything: something is in the way, or hides what they hit."""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from mcap_landmarks.inspection.finding import Finding
from mcap_landmarks.inspection.survey import Returns, Survey

_LEAST_SCANS = 10
"""Fewer scans say nothing about which beams never return."""
_LEAST_BEAMS = 3
"""Fewer dark beams side by side are dirt or chance, not something in the way."""
_MOST_SECTORS = 3
"""So many dark sectors are named, the longest: the posts of a robot are three or four."""


def check_beams(found: Survey) -> Iterator[Finding]:
    """Sectors in which nothing was ever seen, and LiDARs that never see anything."""
    for topic, returns in sorted(found.returns.items()):
        never = returns.counts == 0
        if returns.scans < _LEAST_SCANS or not never.any():
            continue
        if never.all():
            text = f"no beam returned anything in {returns.scans} scans"
            remedy = "compare ranges with range_min and range_max: a driver that sets these wrong hides every hit"
            yield Finding("problem", "beams", topic, text, remedy)
            continue
        sectors = [sector for sector in _sectors(never) if sector[1] >= _LEAST_BEAMS]
        if sectors:
            longest = sorted(sectors, key=lambda sector: -sector[1])[:_MOST_SECTORS]
            where = ", ".join(_degrees(sector, returns) for sector in sorted(longest))
            text = f"{int(never.sum())} of {len(never)} beams never returned anything in {returns.scans} scans: {where}"
            remedy = "if nothing was there, nothing is wrong; else free the view, or leave it out with cluster.view_deg"
            yield Finding("warning", "beams", topic, text, remedy)


def _sectors(never: NDArray[np.bool_]) -> list[tuple[int, int]]:
    """First beam and number of beams of each run of True."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], never, [False]]).astype(np.int8)))
    return [(int(first), int(end - first)) for first, end in zip(edges[::2], edges[1::2], strict=True)]


def _degrees(sector: tuple[int, int], returns: Returns) -> str:
    first, count = sector
    angles = returns.angle_min_rad + returns.angle_increment_rad * np.array([first, first + count - 1])
    low, high = np.rad2deg(angles).round().astype(int)
    return f"{low} to {high} deg"
