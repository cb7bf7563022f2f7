"""Another one that writes the same channel, from scans."""

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np
from mcap_landmarks.channels import SCAN, SCENE_OBJECTS
from mcap_landmarks.messages.scene import SceneObjects
from mcap_landmarks.stage import Bundle, Omission, Stage, Stamped


@dataclass(frozen=True, slots=True)
class EchoesConfig:
    """Nothing can be set."""

    method: Literal["default", "thesis"] = "default"


def process(
    bundles: Iterable[Bundle], _config: EchoesConfig, _resources: Mapping[str, Path]
) -> Iterator[Stamped | Omission]:
    """A scene without objects for every scan."""
    for bundle in bundles:
        scene = SceneObjects(
            bundle.stamp_ns, "base_footprint", (), (), np.zeros((0, 2)), np.zeros((0, 2, 2)), np.zeros(0)
        )
        yield Stamped(SCENE_OBJECTS, bundle.log_time_ns, scene)


STAGE = Stage("echoes", reads=(SCAN,), writes=(SCENE_OBJECTS,), config=EchoesConfig, process=process)
