"""The landmark map in memory: landmarks, groups seen together, and what the map was made from."""

from collections import Counter
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Literal, TypeVar, get_args

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mcap_landmarks.classes import is_movable
from mcap_landmarks.errors import MapError
from mcap_landmarks.geometry.se2 import Array
from mcap_landmarks.locations import location
from mcap_landmarks.structured import StructuredArray, objects

if TYPE_CHECKING:
    import pandas as pd

Scalar = TypeVar("Scalar", bound=np.generic)
SourceKind = Literal["recording", "reference", "import"]


@dataclass(frozen=True, slots=True)
class MapSource:
    """One thing that a map was made from.

    fingerprint: identity by content, never by path or time. bundles: how many it had, used: how many of them took part.
    """

    kind: SourceKind
    fingerprint: str
    bundles: int = 0
    used: int = 0

    def __post_init__(self) -> None:
        if self.kind not in get_args(SourceKind) or not self.fingerprint:
            raise MapError(f"source {self.kind!r} {self.fingerprint!r}: needs a kind and a fingerprint")
        if not 0 <= self.used <= self.bundles:
            raise MapError(f"source {self.fingerprint}: used {self.used} of {self.bundles} bundles is impossible")


@dataclass(frozen=True, slots=True, eq=False)
class Group:
    """Landmarks seen together (thesis section 4.5), left to right as seen from `map_from_base`.

    map_from_base (3,) is x, y in metres and heading in radians, covariance its (3, 3) or None where unknown.
    """

    landmark_ids: tuple[str, ...]
    map_from_base: Array
    covariance: Array | None = None

    def __post_init__(self) -> None:
        name = f"group {', '.join(self.landmark_ids)}"
        if not self.landmark_ids or len(set(self.landmark_ids)) != len(self.landmark_ids):
            raise MapError(f"{name}: needs landmarks, each of them once")
        _set(self, "map_from_base", _array(self.map_from_base, (3,), f"{name}: pose"))
        if self.covariance is not None:
            covariance = _array(self.covariance, (3, 3), f"{name}: covariance")
            if not _valid_covariances(covariance[None]).all():
                raise MapError(f"{name}: covariance is not symmetric and positive definite")
            _set(self, "covariance", _symmetric(covariance))


@dataclass(frozen=True, slots=True, eq=False)
class LandmarkMap:
    """N landmarks in `frame`. Valid by construction; arrays are copied and read-only.

    positions_xy (N, 2) m are centres of cross-sections, covariances (N, 2, 2) m^2 (all zero where unknown), radii_m
    (N,) (zero where unknown), sightings (N,) how many bundles saw each, tentative (N,) true where too few did.

    Raises:
        MapError: ids not unique, shapes that do not fit, numbers not finite, a covariance neither zero nor positive
            definite, a group of unknown landmarks.
    """

    ids: tuple[str, ...]
    classes: tuple[str, ...]
    positions_xy: Array
    covariances: Array
    radii_m: Array
    sightings: NDArray[np.int64]
    tentative: NDArray[np.bool_]
    groups: tuple[Group, ...] = ()
    sources: tuple[MapSource, ...] = ()
    frame: str = "map"

    def __post_init__(self) -> None:
        n = len(self.ids)
        if len(set(self.ids)) != n or not all(self.ids):
            raise MapError("landmark ids are empty or not unique; give each landmark an id of its own")
        if len(self.classes) != n or not all(self.classes):
            raise MapError("a landmark has no class; name one for each")
        if not self.frame:
            raise MapError("the map's frame has no name; call it map")
        _set(self, "positions_xy", _array(self.positions_xy, (n, 2), "landmark positions"))
        _set(self, "covariances", _array(self.covariances, (n, 2, 2), "landmark covariances"))
        _set(self, "radii_m", _array(self.radii_m, (n,), "landmark radii"))
        _set(self, "sightings", _whole(self.sightings, n))
        _set(self, "tentative", _frozen(np.array(self.tentative, dtype=np.bool_).reshape(n)))
        self._check_values()

    def __len__(self) -> int:
        return len(self.ids)

    def __repr__(self) -> str:
        classes = ", ".join(f"{count} {name}" for name, count in sorted(Counter(self.classes).items()))
        return f"<LandmarkMap of {len(self)} landmarks, {int(self.tentative.sum())} tentative: {classes or 'none'}>"

    @classmethod
    def read(cls, path: str | Path) -> "LandmarkMap":
        """The map in a landmark database, or in a file that `landmarks import` takes (.csv, .json, .txt).

        Raises:
            MapError: there is no such file, or no map in it.
        """
        from mcap_landmarks.maps.map_files import read_map_file  # noqa: PLC0415 - it imports this

        return read_map_file(location(path))

    def write(self, path: str | Path, *, overwrite: bool = False) -> None:
        """Write the map as a landmark database (.db), or as `landmarks export` does (.csv, .json, .txt).

        Raises:
            UsageError: the name ends in none of these, or there is a file already that is not to be overwritten.
            ToolkitError: the map has not what the format needs, or the file cannot be written.
        """
        from mcap_landmarks.maps.map_files import write_map_file  # noqa: PLC0415 - it imports this

        write_map_file(location(path), self, overwrite=overwrite)

    @property
    def landmarks(self) -> StructuredArray:
        """A row per landmark: id, class, x_m, y_m, var_x_m2, cov_xy_m2, var_y_m2, radius_m, sightings, tentative."""
        return StructuredArray.of(
            {
                "id": objects(self.ids),
                "class": objects(self.classes),
                "x_m": self.positions_xy[:, 0],
                "y_m": self.positions_xy[:, 1],
                "var_x_m2": self.covariances[:, 0, 0],
                "cov_xy_m2": self.covariances[:, 0, 1],
                "var_y_m2": self.covariances[:, 1, 1],
                "radius_m": self.radii_m,
                "sightings": self.sightings,
                "tentative": self.tentative,
            }
        )

    def to_pandas(self) -> "pd.DataFrame":
        """`landmarks` as a data frame.

        Raises:
            UsageError: pandas is not installed.
        """
        return self.landmarks.to_pandas()

    @property
    def movable(self) -> NDArray[np.bool_]:
        """Which landmarks (N,) may stand elsewhere another day, by their classes."""
        return np.array([is_movable(name) for name in self.classes], dtype=np.bool_)

    def without_movable(self) -> "LandmarkMap":
        """The map of those landmarks that stay where they are; groups keep what is left of them."""
        keep = np.flatnonzero(~self.movable)
        ids = tuple(self.ids[i] for i in keep)
        left = [(group, tuple(name for name in group.landmark_ids if name in {*ids})) for group in self.groups]
        return replace(
            self,
            ids=ids,
            classes=tuple(self.classes[i] for i in keep),
            positions_xy=self.positions_xy[keep],
            covariances=self.covariances[keep],
            radii_m=self.radii_m[keep],
            sightings=self.sightings[keep],
            tentative=self.tentative[keep],
            groups=tuple(replace(group, landmark_ids=names) for group, names in left if names),
        )

    def _check_values(self) -> None:
        known = self.covariances.any(axis=(1, 2))
        for i in np.flatnonzero(known)[~_valid_covariances(self.covariances[known])]:
            raise MapError(f"landmark {self.ids[i]}: covariance is not symmetric and positive definite")
        _set(self, "covariances", _symmetric(self.covariances))
        for i in np.flatnonzero((self.radii_m < 0) | (self.sightings < 0)):
            raise MapError(f"landmark {self.ids[i]}: radius and sightings must not be negative")
        ids = set(self.ids)
        for group in self.groups:
            for unknown in set(group.landmark_ids) - ids:
                raise MapError(f"group {', '.join(group.landmark_ids)}: there is no landmark {unknown}")

    @classmethod
    def surveyed(
        cls, ids: tuple[str, ...], classes: tuple[str, ...], positions_xy: ArrayLike, source: MapSource
    ) -> "LandmarkMap":
        """Map of N known positions (N, 2) about which nothing else is known."""
        n = len(ids)
        points = np.array(positions_xy, dtype=np.float64).reshape(-1, 2)
        zeros = np.zeros(n)
        return cls(
            ids, classes, points, np.zeros((n, 2, 2)), zeros, zeros.astype(int), zeros.astype(bool), sources=(source,)
        )


def _symmetric(covariances: Array) -> Array:
    """Covariances without the rounding of whoever computed them."""
    return _frozen((covariances + np.swapaxes(covariances, -1, -2)) / 2)


def _valid_covariances(covariances: Array) -> NDArray[np.bool_]:
    skew = np.abs(covariances - np.swapaxes(covariances, 1, 2)).max(axis=(1, 2), initial=0)
    lowest = np.linalg.eigvalsh(covariances).min(axis=1, initial=np.inf)
    valid: NDArray[np.bool_] = np.logical_and(lowest > 0, skew <= 1e-6 * np.trace(covariances, axis1=1, axis2=2))
    return valid


def _array(values: ArrayLike, shape: tuple[int, ...], what: str) -> Array:
    array: Array = np.array(values, dtype=np.float64)
    if array.size == 0 == np.prod(shape):
        array = array.reshape(shape)
    if array.shape != shape:
        raise MapError(f"{what}: shape {array.shape} instead of {shape}")
    if not np.isfinite(array).all():
        raise MapError(f"{what}: not all numbers are finite")
    return _frozen(array)


def _whole(values: ArrayLike, n: int) -> NDArray[np.int64]:
    return _frozen(np.array(values, dtype=np.int64).reshape(n))


def _frozen(array: NDArray[Scalar]) -> NDArray[Scalar]:
    array.flags.writeable = False
    return array


def _set(instance: object, name: str, value: object) -> None:
    object.__setattr__(instance, name, value)  # the way to convert in a frozen dataclass
