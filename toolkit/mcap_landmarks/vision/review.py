"""The second stage of detection: a classifier looks at every box and may veto or relabel it (Algorithm 1, line 7)."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from mcap_landmarks.messages.hypotheses import Hypotheses
from mcap_landmarks.vision.classifier import Classifier
from mcap_landmarks.vision.pixels import Rgb


@dataclass(frozen=True, slots=True)
class Verdict:
    """What becomes of one box: its hypotheses, best first, or None and the reason why it is left out."""

    hypotheses: Hypotheses | None
    reason: str = ""


def review(
    classifier: Classifier,
    image: Rgb,
    boxes_xyxy: NDArray[np.float64],
    labels: Sequence[tuple[str, float]],
    action: Literal["veto", "relabel"],
    sure: float,
) -> list[Verdict]:
    """A verdict on every box (N, 4) with its label and score.

    The classifier objects where its own best class is another one, with a probability of at least `sure`; it has no say
    about classes that it does not know. A relabelled box keeps its score under the new label, and the detector's label
    follows with the share that the classifier leaves it.
    """
    known = {name: i for i, name in enumerate(classifier.names)}
    verdicts = []
    for (name, score), shares in zip(labels, classifier.probabilities(image, boxes_xyxy), strict=True):
        best = int(shares.argmax())
        other = classifier.names[best]
        if name not in known or other == name or shares[best] < sure:
            verdicts.append(Verdict(((name, score),)))
        elif action == "veto":
            verdicts.append(Verdict(None, f"detections of {name} that the classifier takes for {other}"))
        else:
            rest = score * float(shares[known[name]] / shares[best])
            verdicts.append(Verdict(((other, score), (name, rest))))
    return verdicts
