"""How well scans and images become objects: centres against the truth, on looks that nothing was developed on.

python -m tests.benchmark.perception [--json] [--quick]
"""

import sys
from collections.abc import Iterator

import numpy as np

from tests.benchmark import spoilt_detections
from tests.benchmark.centres import FARTHEST_M, Errors, judge, within
from tests.benchmark.rows import Row, main

SEED = 10_000
# Class and variants, and the goal for the median of one scan from 2 to 10 m.
KINDS = {
    "hydrant": ("fire hydrant", ("standard",), 0.015),
    "person in a coat": ("person", ("coat",), 0.015),
    "suitcase": ("suitcase", ("standard",), 0.025),
    "person on legs": ("person", ("legs", "stride"), 0.04),
}
OTHERS = ("bicycle", "car", "traffic light", "stop sign", "bench", "backpack", "sports ball", "chair", "potted plant")
BANDS_M = ((2, 4), (4, 6), (6, 8), (8, 10), (10, FARTHEST_M))
# What an ideal shape's hits and misses allow (targets.md): median and RMS in m by band.
LIMITS_M = {
    "hydrant": ((0.005, 0.006), (0.006, 0.008), (0.008, 0.011), (0.010, 0.013), (0.018, 0.037)),
    "person in a coat": ((0.004, 0.005), (0.005, 0.006), (0.006, 0.008), (0.007, 0.009), (0.009, 0.013)),
    "suitcase": ((0.006, 0.009), (0.008, 0.012), (0.010, 0.018), (0.013, 0.023), (0.027, 0.044)),
    "person on legs": ((0.008, 0.012), (0.012, 0.018), (0.024, 0.047), (0.046, 0.091), (0.086, 0.106)),
}


def measure(quick: bool) -> Iterator[Row]:
    """All rows."""
    yield from centres(120 if quick else 600)
    yield from spoilt_detections.rows(quick)


def centres(count: int) -> Iterator[Row]:
    """Centres from single scans, where the class is given."""
    for label, (name, variants, goal) in KINDS.items():
        errors = judge(name, variants, SEED, 2 * count, far_m=FARTHEST_M)
        near = within(errors, 2, 10)
        yield _row(f"{label}: centre from one scan, 2 to 10 m, median", near, goal)
        yield Row(f"{label}: NEES / 2", float(np.nanmean(near.nees)), cases=len(near.nees))
        yield Row(f"{label}: seen, 2 to 10 m", float(np.isfinite(near.error_m).mean()), cases=len(near.nees))
        for (low, high), (median, rms) in zip(BANDS_M, LIMITS_M[label], strict=True):
            yield _row(f"{label}: {low} to {high:g} m, median", within(errors, low, high), None, median, rms)
    for beams in (720, 1440):
        for label, (name, variants, _) in KINDS.items():
            yield _row(f"{label}: {beams} beams, 2 to 10 m, median", judge(name, variants, SEED, count // 2, beams))
    for name in OTHERS:
        yield _row(f"{name}: 2 to 10 m, median", judge(name, ("",), SEED, count // 2))


def _row(
    name: str, errors: Errors, goal: float | None = None, limit: float | None = None, limit_rms: float | None = None
) -> Row:
    peers = {"RMS": float(np.sqrt(np.nanmean(errors.error_m**2))), "thesis": float(np.nanmedian(errors.thesis_m))}
    peers |= {} if limit is None else {"limit": limit}
    peers |= {} if limit_rms is None else {"limit RMS": limit_rms}
    peers["class probability"] = float(errors.share.mean())
    return Row(name, float(np.nanmedian(errors.error_m)), "m", at_most=goal, cases=len(errors.error_m), peers=peers)


if __name__ == "__main__":
    sys.exit(main(measure, __doc__ or ""))
