"""One picture of everything in the catalog: `python -m mcap_landmarks_generator.contact_sheet OUT.jpg`."""

import argparse
from pathlib import Path

import cv2
import numpy as np

from mcap_landmarks_generator.assets import catalog
from mcap_landmarks_generator.camera import Viewpoint
from mcap_landmarks_generator.drawing import Image
from mcap_landmarks_generator.layout import PlacedObject
from mcap_landmarks_generator.renderer import Renderer
from mcap_landmarks_generator.scenario import BackgroundSpec, GroundSpec, LightSpec, Scenario
from mcap_landmarks_generator.sensor_specs import CameraSpec

CELL_PX = 200
COLUMNS = 8
FIELD_OF_VIEW_DEG = 32.0
YAWS_RAD = (np.pi + 0.5, np.pi - 0.9)
_APART_M = 100.0
"""Beyond what the renderer draws: each object stands alone."""
_LIGHT = LightSpec(azimuth_deg=130, elevation_deg=45)


def sheet(seed: int = 0) -> Image:
    """Every variant of every class and two of each distractor, in rows of eight."""
    names = [(name, variant) for name in (*catalog.CLASSES, *catalog.DISTRACTORS) for variant in catalog.VARIANTS[name]]
    objects = [
        _placed(f"{name} {variant} {copy}", name, variant, seed + copy, len(YAWS_RAD) * row + copy)
        for row, (name, variant) in enumerate(names)
        for copy in range(len(YAWS_RAD))
    ]
    scenario = Scenario(
        camera=CameraSpec(width_px=CELL_PX, height_px=CELL_PX, field_of_view_deg=FIELD_OF_VIEW_DEG),
        background=BackgroundSpec(kind="trees", look=3),
        ground=GroundSpec(kind="concrete", look=4),
        light=_LIGHT,
    )
    renderer = Renderer(scenario, objects)
    cells = [renderer.draw(_view(placed)).image for placed in objects]
    cells += [np.full_like(cells[0], 255)] * (-len(cells) % COLUMNS)
    rows = [np.hstack(cells[start : start + COLUMNS]) for start in range(0, len(cells), COLUMNS)]
    return np.vstack(rows)


def _placed(object_id: str, name: str, variant: str, seed: int, place: int) -> PlacedObject:
    asset = catalog.build(name, variant, seed)
    return PlacedObject(object_id, asset, np.array([[0.0, place * _APART_M]]), YAWS_RAD[place % len(YAWS_RAD)], 0.0)


def _view(placed: PlacedObject) -> Viewpoint:
    """An object that fills the frame, seen from a little above its middle."""
    low, high = placed.asset.bounds_m
    size = 0.5 * max(high[2], *(high - low)[:2] * 0.9)
    away = size * 1.25 / np.tan(np.deg2rad(FIELD_OF_VIEW_DEG) / 2) + placed.asset.footprint_radius_m * 0.5
    middle = np.array([*placed.route_xy[0], high[2] * 0.5])
    eye = middle + np.array([-away, 0.0, size * 0.7])
    return Viewpoint.towards(eye, middle, np.array([0.0, 0.0, 1.0]))


def main() -> None:
    """Write the contact sheet to the file that is named on the command line."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("out", type=Path, help="JPEG or PNG file to write")
    parser.add_argument("--seed", type=int, default=0, help="which individuals to show")
    options = parser.parse_args()
    cv2.imwrite(str(options.out), cv2.cvtColor(sheet(options.seed), cv2.COLOR_RGB2BGR), [cv2.IMWRITE_JPEG_QUALITY, 75])


if __name__ == "__main__":
    main()
