"""A stage as a stranger would add it: something that stands still, for every image."""

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np
from mcap_landmarks.channels import CAMERA_IMAGE, SCENE_MARKERS, SCENE_OBJECTS, TF
from mcap_landmarks.locations import Location
from mcap_landmarks.messages.markers import MarkerArray
from mcap_landmarks.messages.scene import SceneObjects
from mcap_landmarks.messages.transforms import TFMessage
from mcap_landmarks.stage import Bundle, Chosen, InputLog, LeftOut, Omission, Stage, Stamped


@dataclass(frozen=True, slots=True)
class BeaconsConfig:
    """`distance_m`: how far ahead it stands."""

    method: Literal["default", "thesis"] = "default"
    distance_m: float = 1.0


def process(
    bundles: Iterable[Bundle], config: BeaconsConfig, resources: Mapping[str, Path]
) -> Iterator[Stamped | Omission]:
    """One object of the class that the file says."""
    name = resources["label"].read_text().strip()
    for bundle in bundles:
        place, spread, none = np.array([[config.distance_m, 0.0]]), 0.01 * np.eye(2)[None], np.zeros(1)
        scene = SceneObjects(bundle.stamp_ns, "base_footprint", ("1",), (((name, 0.9),),), place, spread, none)
        yield Stamped(SCENE_OBJECTS, bundle.log_time_ns, scene)
        yield Stamped(SCENE_MARKERS, bundle.log_time_ns, MarkerArray(bundle.stamp_ns, "base_footprint", ()))
        yield Stamped(TF, bundle.log_time_ns, TFMessage(()))


def _beside_images(log: InputLog, config: BeaconsConfig) -> str:
    image = log.first(CAMERA_IMAGE)
    return f"/{'nobody' if image is None else image.frame_id}/{config.distance_m:g}"


def _not_here(log: InputLog, _config: BeaconsConfig) -> LeftOut:
    return LeftOut(f"no transforms beside {log.primary.topic}")


def _label(asked: Location | None, generated: bool) -> Chosen:
    del generated
    return Chosen(Path(__file__).with_name("label.txt"), "toy") if asked is None else Chosen(asked, "file")


STAGE = Stage(
    "beacons",
    reads=(CAMERA_IMAGE,),
    writes=(SCENE_OBJECTS, SCENE_MARKERS, TF),
    config=BeaconsConfig,
    process=process,
    thinned=True,
    places={SCENE_MARKERS: _beside_images, TF: _not_here},
    resources=("label",),
    choices={"label": _label},
)
