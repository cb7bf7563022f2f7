"""Tracks whose boxes were of another one: what stands in line with an object, and got its boxes while it was hidden."""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass

from mcap_landmarks.fusion.track_history import is_redundant, where_redundant
from mcap_landmarks.fusion.tracks import TrackTable


@dataclass(slots=True)
class RedundancyCheck:
    """Notes of tracks in the scan whether another one of their class explains their boxes, and more.

    That is judged at images; `bundle` and `stamp_ns` are those of the last one.
    """

    tracks: TrackTable
    bundle: int = 0
    stamp_ns: int = 0

    def at_image(self, names: Iterable[str], stamp_ns: int) -> None:
        """Judge the tracks in a scan that has an image."""
        self.bundle, self.stamp_ns = self.tracks.bundle, stamp_ns
        self._judge(names)

    def between_images(self, names: Iterable[str]) -> None:
        """Judge tracks that come back without an image, as of the last one; to be called before their scan counts."""
        self._judge(name for name in names if name in self.tracks and self.tracks[name].judged < self.bundle)

    def _judge(self, names: Iterable[str]) -> None:
        known: dict[str, bool] = {}
        for name in names:
            track = self.tracks[name]
            track.is_redundant, track.judged = self._is_redundant(name, known), self.bundle

    def _is_redundant(self, name: str, known: dict[str, bool]) -> bool:
        """Whether a track is redundant: one that came before it does not count if it is redundant itself."""
        if name not in known:
            known[name] = self.tracks.is_known(name, self.stamp_ns) and any(
                self.tracks[other].number > self.tracks[name].number or not self._is_redundant(other, known)
                for other in self._explaining(name)
            )
        return known[name]

    def _explaining(self, name: str) -> Iterator[str]:
        """The tracks that explain the boxes of one, and more."""
        own = self.tracks[name]
        class_name, _ = own.belief.best()
        size = self.tracks.config.size(class_name)
        for other in self.tracks.near(where_redundant(own.history, class_name), self.stamp_ns):
            track = self.tracks[other]
            if other == name or track.belief.best()[0] != class_name:
                continue
            if is_redundant(own.history, track.history, class_name, size, self.bundle):
                yield other
