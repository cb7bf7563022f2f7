"""What detections have said about a track so far: log odds of every class against none of them."""

import math
from dataclasses import dataclass, field

from mcap_landmarks.fusion.config import FuseConfig

_REMEMBERED, _TOO_FAR_ASIDE = 5, 4.0
"""Over how many detections `aside` is averaged, and how many sigmas of that average are too many: one track in 16,000
would be so far off by chance."""
_RADIUS_GAIN = 0.3
"""What a new radius counts in the average, which so forgets one half of what was two boxes ago."""


@dataclass(slots=True)
class ClassBelief:
    """One track's log odds by class: a Bayes filter of a state that stays (Thrun, Burgard, Fox 2005, section 4.2).

    `other` is that of every class which no detection has named. A track is of a class with odds `prior_odds` before
    anything is seen. A detection multiplies the odds of its class by how much likelier it is if the track is of it, at
    most by `hit_odds`, and those of every other by `confusion` times that, since some detections have a wrong class; an
    image that should show the object but has no box there multiplies all by `miss_odds`. Odds stay below `max_odds`,
    so that what was learned wrong can be forgotten. A track that no later scan can go on with is `alone`, and begins
    at odds `prior_odds_alone`: no second look could mend what is left out. `aside` is how far aside of their middles
    detections were on average lately, in sigmas, positive to the left.
    """

    config: FuseConfig
    alone: bool = False
    other: float = 0.0
    log_odds: dict[str, float] = field(default_factory=dict)
    radii_m: dict[str, float] = field(default_factory=dict)
    hits: int = 0
    aside: float = 0.0

    def __post_init__(self) -> None:
        self.other = math.log(self.config.prior_odds_alone if self.alone else self.config.prior_odds)

    def hit(self, name: str, ratio: float, aside: float, fresh: float) -> None:
        """A detection of a class fell on the track, so many sigmas aside of its middle.

        `ratio` is how much likelier it is if the track is of the class than if not. It counts to a share `fresh`.
        If they always do so on the same side, they are of something beside it, and count as a miss.
        """
        self.hits += 1
        self.aside += (aside - self.aside) / min(self.hits, _REMEMBERED)
        if self.hits > 1 and abs(self.aside) * math.sqrt(min(self.hits, _REMEMBERED)) > _TOO_FAR_ASIDE:
            self.miss(fresh)
            return
        missed = self.config.miss_odds
        whole = missed + (1 - missed) * min(ratio, self.config.hit_odds)
        gain, confused = fresh * math.log(whole), math.log(self.config.confusion)
        self.log_odds.setdefault(name, self.other)
        self.log_odds = {known: value + gain + confused for known, value in self.log_odds.items()}
        self.log_odds[name] -= confused
        self.other += gain + confused
        self._limit()

    def miss(self, fresh: float) -> None:
        """An image shows the track's place, and nothing there; it counts to a share `fresh`."""
        lost = fresh * math.log(self.config.miss_odds)
        self.log_odds = {name: value + lost for name, value in self.log_odds.items()}
        self.other += lost
        self._limit()

    def measure(self, name: str, radius_m: float) -> None:
        """A box of a class had the width of a disc of a radius; radii are averaged, later ones count for more."""
        before = self.radii_m.get(name, radius_m)
        self.radii_m[name] = (1 - _RADIUS_GAIN) * before + _RADIUS_GAIN * radius_m

    def _limit(self) -> None:
        """Keep what is said for and against the track within bounds."""
        least = math.log(self.config.prior_odds / self.config.max_odds)
        over = max(max([*self.log_odds.values(), self.other]) - math.log(self.config.max_odds), 0.0)
        self.log_odds = {name: max(value - over, least) for name, value in self.log_odds.items()}
        self.other = max(self.other - over, least)

    def share(self, name: str) -> float:
        """The probability that the track is of a class."""
        odds = {known: math.exp(value) for known, value in self.log_odds.items()}
        own = odds.get(name, math.exp(self.other))
        return own / (1 + sum(odds.values()) + (0.0 if name in odds else own))

    def probabilities(self) -> list[tuple[str, float]]:
        """Classes that detections named with their probabilities, most probable first."""
        odds = {name: math.exp(value) for name, value in self.log_odds.items()}
        whole = sum(odds.values()) + 1.0
        return sorted(((name, value / whole) for name, value in odds.items()), key=lambda entry: (-entry[1], entry[0]))

    def best(self) -> tuple[str, float]:
        """The most probable class that detections named, and its probability; no class if there was none."""
        return self.probabilities()[0] if self.log_odds else ("", 0.0)
