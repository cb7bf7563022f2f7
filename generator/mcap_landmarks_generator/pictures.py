"""Makes the pictures of the generator's README: `python -m mcap_landmarks_generator.pictures`."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
from mcap_landmarks.geometry.se2 import transform_points
from mcap_landmarks.messages.images import CompressedImage
from mcap_landmarks.messages.scan import LaserScan
from mcap_landmarks.stage import Stamped
from numpy.typing import NDArray

from mcap_landmarks_generator.bundled import bundled
from mcap_landmarks_generator.camera import ImageJob, Intrinsics, Viewpoint
from mcap_landmarks_generator.checks import Staged, stage
from mcap_landmarks_generator.drawing import Image
from mcap_landmarks_generator.lidar import beam_angles
from mcap_landmarks_generator.loading import load_scenario
from mcap_landmarks_generator.renderer import Renderer
from mcap_landmarks_generator.rendering import Photographer
from mcap_landmarks_generator.ring_cloud import RingCloud
from mcap_landmarks_generator.robot import SCAN_IN_BASE_M
from mcap_landmarks_generator.simulation import Simulation
from mcap_landmarks_generator.trajectory import legs_of

Floats = NDArray[np.float64]

_FOLDER = Path(__file__).parents[1] / "images"
_WAY, _BEAM, _FIELD = (255, 200, 0), (255, 60, 40), (40, 160, 255)
_FULL_TURN_DEG = 360


def make_all() -> None:
    """Write every picture anew."""
    # From above the ground's texture would be seen to repeat.
    world = stage(load_scenario("thesis_map", ["ground.tile_m=12"]))
    _write("thesis_top", top_view(world, width_px=1100, side_m=108.0))
    _write("thesis_birds_eye", birds_eye(world, (1280, 640)))
    _write("lidar_field_of_view", lidar_field(world, width_px=760, side_m=31.0))
    for name in sorted(bundled()):
        if not name.endswith("_drift"):
            _write(name, first_good_image(stage(load_scenario(name))))
            _write(f"{name}_lidar", returns_from_above(stage(load_scenario(name))))


def top_view(staged: Staged, width_px: int, side_m: float) -> Image:
    """The whole world from straight above, north up, with the robot's way (thesis, Figures 5.1 and 5.2)."""
    eye = np.array([0.0, 0.0, 150.0])
    view, image = _from_above(staged, eye, width_px, side_m)
    pixel_from = _projection(view, width_px, side_m)
    for leg in legs_of(staged.scenario.trajectory, staged.start):
        _line(image, pixel_from(leg.way_xy), _WAY)
        cv2.circle(image, _whole(pixel_from(leg.way_xy[-1:])[0]), 5, _WAY, -1, cv2.LINE_AA)
    return image


def birds_eye(staged: Staged, size_px: tuple[int, int]) -> Image:
    """The world from a height, seen from the south (thesis, Figure 4.1)."""
    view = Viewpoint.towards(np.array([0.0, -102.0, 48.0]), np.array([0.0, -8.0, 0.0]), np.array([0.0, 0.0, 1.0]))
    camera = replace(staged.scenario.camera, width_px=size_px[0], height_px=size_px[1], field_of_view_deg=54.0)
    return Renderer(replace(staged.scenario, camera=camera), staged.objects, 250.0, 250.0).draw(view).image


def lidar_field(staged: Staged, width_px: int, side_m: float) -> Image:
    """The first scan from above: its range, its beams, and the camera's field of view (thesis, Figure 4.3)."""
    spec = replace(staged.scenario.lidar, dropout=0.0)
    scene = replace(staged, scenario=replace(staged.scenario, lidar=spec))
    scan = next(
        event.message
        for event in Simulation(scene).run()
        if isinstance(event, Stamped) and isinstance(event.message, LaserScan)
    )
    lidar = transform_points(staged.start, SCAN_IN_BASE_M[:2])
    eye = np.array([*transform_points(staged.start, (3.0, 0.0)), 60.0])
    view, image = _from_above(staged, eye, width_px, side_m)
    pixel_from = _projection(view, width_px, side_m)
    directions = beam_angles(spec) + staged.start[2]
    rays = np.stack([np.cos(directions), np.sin(directions)], axis=1)
    for ray, distance in zip(rays, scan.ranges_m, strict=True):
        if np.isfinite(distance):
            _line(image, pixel_from(np.stack([lidar, lidar + ray * distance])), _BEAM)
    half = np.deg2rad(staged.scenario.camera.field_of_view_deg / 2)
    edge = staged.start[2] + np.linspace(-half, half, 60)
    arc = lidar + spec.range_max_m * np.stack([np.cos(edge), np.sin(edge)], axis=1)
    _line(image, pixel_from(np.concatenate([[lidar], arc, [lidar]])), _FIELD)
    circle = np.linspace(0, 2 * np.pi, _FULL_TURN_DEG)
    _line(image, pixel_from(lidar + spec.range_max_m * np.stack([np.cos(circle), np.sin(circle)], axis=1)), _FIELD)
    cv2.circle(image, _whole(pixel_from(lidar[None])[0]), 6, _WAY, -1, cv2.LINE_AA)
    return image


def returns_from_above(staged: Staged, after_s: float = 8.0, size_px: tuple[int, int] = (640, 480)) -> Image:
    """What the LiDAR of most rings meets in one turn, seen from above, ahead to the right: colours tell heights from
    the ground (blue) to 3 m, of a planar LiDAR intensities, if it has any."""
    rings = staged.scenario.ring_lidar
    wanted, reach_m = (RingCloud, 32.0) if rings is not None else (LaserScan, staged.scenario.lidar.range_max_m)
    message = next(
        event.message
        for event in Simulation(staged).run()
        if isinstance(event, Stamped)
        and isinstance(event.message, wanted)
        and event.log_time_ns > staged.scenario.start_ns + after_s * 1e9
    )
    if isinstance(message, RingCloud) and rings is not None:
        points, shades = message.points_m[:, :2], (message.points_m[:, 2] + rings.height_m) / 3.0
    elif isinstance(message, LaserScan):
        seen, angles = np.isfinite(message.ranges_m), beam_angles(staged.scenario.lidar)
        ahead = np.stack([np.cos(angles), np.sin(angles)], axis=1)
        points = message.ranges_m[seen, None] * ahead[seen]
        shades = message.intensities[seen] / 255 if len(message.intensities) else np.full(len(points), 0.5)
    shades = np.rint(255 * np.clip(shades, 0.0, 1.0)).astype(np.uint8)
    colours = cv2.applyColorMap(shades[:, None], cv2.COLORMAP_TURBO)[:, 0, ::-1]
    image = np.zeros((size_px[1], size_px[0], 3), np.uint8)
    scale = size_px[0] / (2 * reach_m)
    pixels = np.rint(np.array(size_px) / 2 + points * (scale, -scale)).astype(int)
    for pixel, colour in zip(pixels, colours, strict=True):
        cv2.circle(image, (int(pixel[0]), int(pixel[1])), 1, colour.tolist(), -1)
    cv2.circle(image, (size_px[0] // 2, size_px[1] // 2), 4, (255, 255, 255), -1, cv2.LINE_AA)
    return image


def first_good_image(staged: Staged) -> Image:
    """The first image of a recording's camera, some way into it, that shows at least three objects well."""
    renderer = Renderer(staged.scenario, staged.objects)
    for event in Simulation(staged).run():
        if not isinstance(event, ImageJob) or event.index % 5 or event.camera:
            continue
        job = event
        large = [one for one in renderer.draw(job.view).visible if one.window.height > 40 and one.window.left > 0]
        if len(large) >= 3:
            break
    taken = next(each.message for each in Photographer(staged).take(job) if isinstance(each.message, CompressedImage))
    image = np.asarray(cv2.imdecode(np.frombuffer(taken.data, np.uint8), cv2.IMREAD_COLOR), np.uint8)
    return np.ascontiguousarray(image[..., ::-1])


def _from_above(staged: Staged, eye: Floats, width_px: int, side_m: float) -> tuple[Viewpoint, Image]:
    """A square of ground around a point, seen from above."""
    view = Viewpoint.towards(eye, np.array([eye[0], eye[1], 0.0]), np.array([0.0, 1.0, 0.0]))
    camera = replace(
        staged.scenario.camera,
        width_px=width_px,
        height_px=width_px,
        field_of_view_deg=float(np.rad2deg(2 * np.arctan(side_m / 2 / eye[2]))),
    )
    return view, Renderer(replace(staged.scenario, camera=camera), staged.objects, 250.0, 250.0).draw(view).image


def _projection(view: Viewpoint, width_px: int, side_m: float) -> Callable[[Floats], Floats]:
    """Function from points (N, 2) on the ground to pixels (N, 2) of `_from_above`."""
    camera = Intrinsics(width_px, width_px, width_px / side_m * float(view.eye_m[2]))

    def pixel_from(points_xy: Floats) -> Floats:
        points = np.column_stack([points_xy, np.zeros(len(points_xy))])
        return camera.project((points - view.eye_m) @ view.world_from_optical)

    return pixel_from


def _line(image: Image, pixels: Floats, colour: Sequence[int]) -> None:
    cv2.polylines(image, [np.rint(pixels * 16).astype(np.int32)], False, colour, 1, cv2.LINE_AA, 4)


def _whole(pixel: Floats) -> tuple[int, int]:
    return round(float(pixel[0])), round(float(pixel[1]))


def _write(name: str, image: Image) -> None:
    cv2.imwrite(str(_FOLDER / f"{name}.jpg"), cv2.cvtColor(image, cv2.COLOR_RGB2BGR), [cv2.IMWRITE_JPEG_QUALITY, 82])


if __name__ == "__main__":
    make_all()
