"""Landmark maps as JSON, with everything that the database holds (schemas/json/landmarks.schema.json)."""

from dataclasses import dataclass
from typing import Annotated, Literal

import numpy as np
from pydantic import ConfigDict, Field, TypeAdapter, ValidationError

from mcap_landmarks.errors import MapError
from mcap_landmarks.maps.model import Group, LandmarkMap, MapSource, SourceKind

_STRICT = ConfigDict(extra="forbid", allow_inf_nan=False, strict=True)
Pair = Annotated[list[float], Field(min_length=2, max_length=2)]
Triple = Annotated[list[float], Field(min_length=3, max_length=3)]


@dataclass(frozen=True, slots=True)
class _Landmark:
    __pydantic_config__ = _STRICT
    id: str
    class_name: Annotated[str, Field(alias="class")]
    x_m: float
    y_m: float
    covariance_m2: Annotated[list[Pair], Field(min_length=2, max_length=2)]
    radius_m: float
    sightings: int
    tentative: bool
    movable: bool = False  # told to readers; the class decides


@dataclass(frozen=True, slots=True)
class _Group:
    __pydantic_config__ = _STRICT
    landmark_ids: list[str]
    x_m: float
    y_m: float
    heading_rad: float
    covariance: Annotated[list[Triple], Field(min_length=3, max_length=3)] | None


@dataclass(frozen=True, slots=True)
class _Source:
    __pydantic_config__ = _STRICT
    kind: SourceKind
    fingerprint: str
    bundles: int
    used: int


@dataclass(frozen=True, slots=True)
class _Document:
    __pydantic_config__ = _STRICT
    schema: Literal["mcap-landmarks/landmarks/1"]
    frame: str
    landmarks: list[_Landmark]
    groups: list[_Group]
    sources: list[_Source]


def parse(text: str, name: str) -> LandmarkMap:
    """The map of a JSON text.

    Raises:
        MapError: with the name of the file, the place, and what was expected there.
    """
    try:
        document = TypeAdapter(_Document).validate_json(text)
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        place = ".".join(str(part) for part in first["loc"]) or "document"
        raise MapError(f"{name}, {place}: {first['msg']}") from error
    try:
        return _landmark_map(document)
    except MapError as error:
        raise MapError(f"{name}: {error}") from error


def _landmark_map(document: _Document) -> LandmarkMap:
    rows = document.landmarks
    return LandmarkMap(
        tuple(row.id for row in rows),
        tuple(row.class_name for row in rows),
        np.array([(row.x_m, row.y_m) for row in rows]),
        np.array([row.covariance_m2 for row in rows]),
        np.array([row.radius_m for row in rows]),
        np.array([row.sightings for row in rows], dtype=np.int64),
        np.array([row.tentative for row in rows], dtype=np.bool_),
        tuple(_group(row) for row in document.groups),
        tuple(MapSource(row.kind, row.fingerprint, row.bundles, row.used) for row in document.sources),
        document.frame,
    )


def _group(row: _Group) -> Group:
    covariance = None if row.covariance is None else np.array(row.covariance)
    return Group(tuple(row.landmark_ids), np.array([row.x_m, row.y_m, row.heading_rad]), covariance)


def document(landmark_map: LandmarkMap) -> dict[str, object]:
    """The map as a JSON document, numbers to the last bit."""
    movable = landmark_map.movable
    landmarks = [
        {
            "id": identity,
            "class": landmark_map.classes[i],
            "x_m": float(landmark_map.positions_xy[i, 0]),
            "y_m": float(landmark_map.positions_xy[i, 1]),
            "covariance_m2": landmark_map.covariances[i].tolist(),
            "radius_m": float(landmark_map.radii_m[i]),
            "sightings": int(landmark_map.sightings[i]),
            "tentative": bool(landmark_map.tentative[i]),
            "movable": bool(movable[i]),
        }
        for i, identity in enumerate(landmark_map.ids)
    ]
    groups = [
        {
            "landmark_ids": list(group.landmark_ids),
            **dict(zip(("x_m", "y_m", "heading_rad"), group.map_from_base.tolist(), strict=True)),
            "covariance": None if group.covariance is None else group.covariance.tolist(),
        }
        for group in landmark_map.groups
    ]
    sources = [
        {"kind": source.kind, "fingerprint": source.fingerprint, "bundles": source.bundles, "used": source.used}
        for source in landmark_map.sources
    ]
    return {
        "schema": "mcap-landmarks/landmarks/1",
        "frame": landmark_map.frame,
        "landmarks": landmarks,
        "groups": groups,
        "sources": sources,
    }
