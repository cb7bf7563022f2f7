"""Compare two landmark databases: landmarks by class and position, groups by the landmarks in them."""

from collections.abc import Callable, Hashable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from mcap_landmarks.diff.channel import ChannelDiff
from mcap_landmarks.diff.declared import rows_of
from mcap_landmarks.diff.document import ManifestRow
from mcap_landmarks.diff.fields import Batch, Fields, texts
from mcap_landmarks.diff.pairs import Pairs, pair_keys, pair_points
from mcap_landmarks.diff.tally import Tally
from mcap_landmarks.diff.values import Flags
from mcap_landmarks.evaluation.alignment import fit, search
from mcap_landmarks.evaluation.landmark_metrics import GATE_M, associate
from mcap_landmarks.evaluation.pose_metrics import align
from mcap_landmarks.geometry.se2 import Array, compose, rotation, transform_points
from mcap_landmarks.mapping.common_frame import align as align_points
from mcap_landmarks.maps.model import Group, LandmarkMap
from mcap_landmarks.messages.columns import Column, Kind
from mcap_landmarks.messages.scene import SceneObjects
from mcap_landmarks.stage import Tolerance

FIELDS = {
    "landmarks": ("class", "position_m", "covariance", "radius_m", "sightings", "tentative"),
    "groups": ("order", "position_m", "heading_rad", "covariance"),
}
"""What is compared of a map."""


_CONSENSUS = 3
"""So many landmarks that agree are more than chance: any two agree after some motion."""


@dataclass(frozen=True, slots=True, eq=False)
class MapDiff:
    """What differs between two maps; `baseline_from_candidate` (3,) is the alignment, None without one."""

    manifest: list[ManifestRow]
    landmarks: ChannelDiff
    groups: ChannelDiff
    baseline_from_candidate: Array | None = None


def diff_maps(
    baseline: LandmarkMap,
    candidate: LandmarkMap,
    tolerance: Callable[[str, str], Tolerance],
    *,
    aligned: bool = False,
) -> MapDiff:
    """Compare two maps, the candidate as it stands or moved onto the baseline by the one SE(2) that fits best.

    `tolerance` gives that of a field of `landmarks` or `groups`. Ids are names that each map gives as it likes.
    """
    transform = None
    if aligned:
        transform = _baseline_from(candidate, baseline)
        candidate = moved(candidate, transform)
    landmarks = ChannelDiff("landmark", partial(tolerance, "landmarks"), "landmarks")
    pairs = pair_points(
        (np.zeros(len(baseline), dtype=np.int64), np.zeros(len(candidate), dtype=np.int64)),
        (baseline.positions_xy, candidate.positions_xy),
        (_labels(baseline.classes), _labels(candidate.classes)),
    )
    _tally(
        landmarks.rows,
        _landmarks(baseline),
        _landmarks(candidate),
        pairs,
        ids=np.zeros(len(pairs.baseline), dtype=bool),
    )
    groups = ChannelDiff("group", partial(tolerance, "groups"), "groups")
    partner = dict(zip(pairs.candidate.tolist(), pairs.baseline.tolist(), strict=True))
    names = {identity: str(row) for row, identity in enumerate(baseline.ids)}
    others = {identity: str(partner.get(row, f"+{row}")) for row, identity in enumerate(candidate.ids)}
    sets = _sets(baseline.groups, names), _sets(candidate.groups, others)
    shown = {str(row): identity for row, identity in enumerate(baseline.ids)}
    shown.update({f"+{row}": f"+{identity}" for row, identity in enumerate(candidate.ids)})
    mine, theirs = _groups(baseline, names, shown), _groups(candidate, others, shown)
    _tally(groups.rows, mine, theirs, pair_keys(*sets))
    return MapDiff(rows_of(_origin(baseline), _origin(candidate)), landmarks, groups, transform)


def moved(landmark_map: LandmarkMap, dst_from_map: Array) -> LandmarkMap:
    """A map in another frame of the plane."""
    turn = rotation(dst_from_map[2])
    groups = []
    for group in landmark_map.groups:
        covariance = group.covariance
        if covariance is not None:
            covariance = align(dst_from_map, group.map_from_base[None], covariance[None])[1][0]
        groups.append(Group(group.landmark_ids, compose(dst_from_map, group.map_from_base), covariance))
    return replace(
        landmark_map,
        positions_xy=transform_points(dst_from_map, landmark_map.positions_xy),
        covariances=turn @ landmark_map.covariances @ turn.T,
        groups=tuple(groups),
    )


def _baseline_from(candidate: LandmarkMap, baseline: LandmarkMap) -> Array:
    """The transform (3,) under which most landmarks of two maps agree; what moved in between has no say in it."""
    same_class = np.array(candidate.classes, dtype=np.str_)[:, None] == np.array(baseline.classes, dtype=np.str_)
    _, partner = search(candidate.positions_xy, baseline.positions_xy, same_class, GATE_M / 3)
    right, left = np.flatnonzero(partner >= 0), partner[partner >= 0]
    if len(right) >= _CONSENSUS:
        return align_points(candidate.positions_xy[right], baseline.positions_xy[left])
    left, right = associate(_scene(baseline), _scene(candidate))
    return fit(candidate.positions_xy[right], baseline.positions_xy[left])


def _tally(tally: Tally, baseline: Batch, candidate: Batch, pairs: Pairs, ids: Flags | None = None) -> None:
    tally.compare(baseline.take(pairs.baseline), candidate.take(pairs.candidate), ids)
    tally.only("removed", baseline.take(pairs.removed))
    tally.only("added", candidate.take(pairs.added))


def _landmarks(side: LandmarkMap) -> Batch:
    classes = _labels(side.classes)
    columns = {
        "id": Column(Kind.TEXT, _labels(side.ids)[:, None]),
        "class": Column(Kind.TEXT, classes[:, None]),
        "position_m": _numbers(side.positions_xy),
        "covariance": _numbers(side.covariances.reshape(-1, 4)),
        "radius_m": _numbers(side.radii_m[:, None]),
        "sightings": _numbers(side.sightings[:, None]),
        "tentative": _numbers(side.tentative[:, None].astype(np.uint8)),
    }
    return Batch(Fields(columns), classes, None)


def _groups(side: LandmarkMap, names: Mapping[str, str], shown: Mapping[str, str]) -> Batch:
    class_of = dict(zip(side.ids, side.classes, strict=True))
    order = [", ".join(shown[names[identity]] for identity in group.landmark_ids) for group in side.groups]
    unknown = np.full((3, 3), np.nan)
    spreads = [unknown if group.covariance is None else group.covariance for group in side.groups]
    poses = np.array([group.map_from_base for group in side.groups]).reshape(-1, 3)
    columns = {
        "order": Column(Kind.TEXT, _labels(order)[:, None]),
        "position_m": _numbers(poses[:, :2]),
        "heading_rad": _numbers(poses[:, 2:]),
        "covariance": _numbers(np.array(spreads).reshape(-1, 9)),
    }
    labels = [", ".join(class_of[identity] for identity in group.landmark_ids) for group in side.groups]
    return Batch(Fields(columns), _labels(labels), None)


def _sets(groups: Sequence[Group], names: Mapping[str, str]) -> list[Hashable]:
    return [frozenset(names[identity] for identity in group.landmark_ids) for group in groups]


def _origin(side: LandmarkMap) -> dict[str, object]:
    """What a map was made from."""
    sources = {
        f"sources.{source.kind}.{source.fingerprint}": f"{source.used} of {source.bundles} bundles"
        for source in side.sources
    }
    return {"frame": side.frame, **sources}


def _scene(side: LandmarkMap) -> SceneObjects:
    hypotheses = tuple(((name, 1.0),) for name in side.classes)
    return SceneObjects(0, side.frame, side.ids, hypotheses, side.positions_xy, side.covariances, side.radii_m)


def _labels(found: Sequence[str]) -> NDArray[np.object_]:
    return texts([text.encode() for text in found])


def _numbers(values: NDArray[np.number]) -> Column:
    return Column(Kind.NUMBER, values)
