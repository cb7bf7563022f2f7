"""One picture of everything in the catalog: `python -m mcap_landmarks_generator.assets.contact_sheet OUT.jpg`."""

import argparse
from pathlib import Path

import cv2
import numpy as np

from mcap_landmarks_generator.assets import catalog, ground, sky
from mcap_landmarks_generator.assets.asset import Asset
from mcap_landmarks_generator.assets.backdrop import Backdrop, Pinhole
from mcap_landmarks_generator.assets.bullet import AssetStore
from mcap_landmarks_generator.assets.shadow import cast_shadow
from mcap_landmarks_generator.assets.texture import Image
from mcap_landmarks_generator.engine import pybullet

CELL_PX = (200, 200)
COLUMNS = 8
OVERSAMPLING = 3
FIELD_OF_VIEW_RAD = np.deg2rad(32.0)
TOWARDS_LIGHT = np.array([-0.45, 0.55, 0.75])
YAWS_RAD = (np.pi + 0.5, np.pi - 0.9)


def sheet(seed: int = 0) -> Image:
    """Every variant of every class and two of each distractor, in rows of eight."""
    names = [(name, variant) for name in (*catalog.CLASSES, *catalog.DISTRACTORS) for variant in catalog.VARIANTS[name]]
    width, height = (side * OVERSAMPLING for side in CELL_PX)
    camera = Pinhole.of(width, height, height / 2 / np.tan(FIELD_OF_VIEW_RAD / 2))
    backdrop = Backdrop(camera, sky.panorama("trees", 3), ground.texture("concrete", 4))
    client = pybullet.connect(pybullet.DIRECT)
    cells = []
    try:
        with AssetStore(client) as store:
            for name, variant in names:
                for copy, yaw in enumerate(YAWS_RAD):
                    asset = catalog.build(name, variant, seed + copy)
                    cells.append(_cell(client, store, backdrop, asset, yaw))
    finally:
        pybullet.disconnect(client)
    cells += [np.full_like(cells[0], 255)] * (-len(cells) % COLUMNS)
    rows = [np.hstack(cells[start : start + COLUMNS]) for start in range(0, len(cells), COLUMNS)]
    return np.vstack(rows)


def _cell(client: int, store: AssetStore, backdrop: Backdrop, asset: Asset, yaw_rad: float) -> Image:
    """One asset, filling the frame, seen from a little above its middle."""
    low, high = asset.bounds_m
    size = 0.5 * max(high[2], *(high - low)[:2] * 0.9)
    distance = size * 1.25 / np.tan(FIELD_OF_VIEW_RAD / 2) + asset.footprint_radius_m * 0.5
    eye, target = np.array([-distance, 0.0, high[2] * 0.5 + size * 0.7]), np.array([0.0, 0.0, high[2] * 0.5])
    width, height = (side * OVERSAMPLING for side in CELL_PX)
    bodies = store.spawn(asset, yaw_rad=yaw_rad)
    view = pybullet.computeViewMatrix(eye.tolist(), target.tolist(), [0, 0, 1])
    projection = pybullet.computeProjectionMatrixFOV(np.rad2deg(FIELD_OF_VIEW_RAD), width / height, 0.05, 60.0)
    *_, rgba, _, segmentation = pybullet.getCameraImage(
        width, height, view, projection, shadow=0, lightDirection=(30 * TOWARDS_LIGHT).tolist(),
        lightAmbientCoeff=0.55, lightDiffuseCoeff=0.6, lightSpecularCoeff=0.05,
        renderer=pybullet.ER_TINY_RENDERER, physicsClientId=client,
    )  # fmt: skip
    for body in bodies:
        pybullet.removeBody(body.body_id, physicsClientId=client)
    image = np.array(rgba, np.uint8).reshape(height, width, 4)[..., :3]
    behind = np.array(segmentation).reshape(height, width) < 0
    image[behind] = _behind(backdrop, asset, yaw_rad, eye, target)[behind]
    small = cv2.resize(image, CELL_PX, interpolation=cv2.INTER_AREA)
    return np.asarray(small, np.uint8)


def _behind(backdrop: Backdrop, asset: Asset, yaw_rad: float, eye: np.ndarray, target: np.ndarray) -> Image:
    """Sky and ground with the asset's shadow, for a camera that looks from `eye` to `target`."""
    forward = (target - eye) / np.linalg.norm(target - eye)
    right = np.cross(forward, [0.0, 0.0, 1.0])
    right /= np.linalg.norm(right)
    turn = np.column_stack([right, np.cross(forward, right), forward])
    return backdrop.view(eye, turn, [cast_shadow(asset, yaw_rad, TOWARDS_LIGHT)])


def main() -> None:
    """Write the contact sheet to the file that is named on the command line."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("out", type=Path, help="JPEG or PNG file to write")
    parser.add_argument("--seed", type=int, default=0, help="which individuals to show")
    options = parser.parse_args()
    cv2.imwrite(str(options.out), cv2.cvtColor(sheet(options.seed), cv2.COLOR_RGB2BGR), [cv2.IMWRITE_JPEG_QUALITY, 75])


if __name__ == "__main__":
    main()
