"""What detections have said about a track so far: log odds of every class against none of them."""

import math
from dataclasses import dataclass, field

_REMEMBERED, _TOO_FAR_ASIDE = 5, 4.0


@dataclass(frozen=True, slots=True)
class Weighing:
    """How much a detection or the lack of one counts.

    A track is of a class with odds `prior` before anything is seen. A detection of score s multiplies the odds of its
    class by `gain` * s / (1 - s), and those of every other by `confusion` times that, since some detections have a
    wrong class; an image that should show the object but has no box there multiplies all by `missed`. Odds stay below
    `most`, so that what was learned wrong can be forgotten.
    """

    prior: float = 0.05
    gain: float = 60.0
    confusion: float = 0.05
    missed: float = 0.5
    most: float = 1e4


@dataclass(slots=True)
class Belief:
    """One track's log odds by class; `other` is that of every class which no detection has named.

    `aside` is how far aside of their middles detections were on average lately, in sigmas, positive to the left.
    """

    weighing: Weighing
    other: float = 0.0
    log_odds: dict[str, float] = field(default_factory=dict)
    radii_m: dict[str, float] = field(default_factory=dict)
    hits: int = 0
    aside: float = 0.0

    def __post_init__(self) -> None:
        self.other = math.log(self.weighing.prior)

    def hit(self, name: str, score: float, aside: float) -> None:
        """A detection of a class fell on the track, so many sigmas aside of its middle.

        If they always do so on the same side, they are of something beside it, and count as a miss.
        """
        self.hits += 1
        self.aside += (aside - self.aside) / min(self.hits, _REMEMBERED)
        if self.hits > 1 and abs(self.aside) * math.sqrt(min(self.hits, _REMEMBERED)) > _TOO_FAR_ASIDE:
            self.miss()
            return
        weighing, sure = self.weighing, min(max(score, 0.05), 0.95)
        gain = math.log(weighing.gain * sure / (1 - sure))
        confused = gain + math.log(weighing.confusion)
        self.log_odds.setdefault(name, self.other)
        self.log_odds = {known: value + confused for known, value in self.log_odds.items()}
        self.log_odds[name] += gain - confused
        self.other += confused
        self._limit()

    def miss(self) -> None:
        """An image shows the track's place, and nothing there."""
        lost, least = math.log(self.weighing.missed), math.log(self.weighing.prior / self.weighing.most)
        self.log_odds = {name: max(value + lost, least) for name, value in self.log_odds.items()}
        self.other = max(self.other + lost, least)

    def _limit(self) -> None:
        over = max(*self.log_odds.values(), self.other) - math.log(self.weighing.most)
        if over > 0:
            self.log_odds = {name: value - over for name, value in self.log_odds.items()}
            self.other -= over

    def probabilities(self) -> list[tuple[str, float]]:
        """Classes that detections named with their probabilities, most probable first."""
        odds = {name: math.exp(value) for name, value in self.log_odds.items()}
        whole = sum(odds.values()) + 1.0
        return sorted(((name, value / whole) for name, value in odds.items()), key=lambda entry: (-entry[1], entry[0]))
