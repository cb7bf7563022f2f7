"""A layout for Foxglove and Lichtblick: panels of what a log really has, as these programs export them.

The structure is that of a layout file: `configById` has a panel's settings under its type and id, `layout` is the tree
of react-mosaic that says where each panel is.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from mcap_landmarks.channels import MAP_POSE, MATCH, POSE, POSE_COVARIANCE, TRUTH_POSE
from mcap_landmarks.evaluation.metrics import RunResult
from mcap_landmarks.messages.images import CompressedImage, Image
from mcap_landmarks.messages.markers import MarkerArray
from mcap_landmarks.messages.points import PointCloud2
from mcap_landmarks.messages.poses import Path, PoseStamped, PoseWithCovarianceStamped
from mcap_landmarks.messages.scan import LaserScan
from mcap_landmarks.messages.video import CompressedVideo
from mcap_landmarks.report.viewed_log import ViewedCamera, ViewedLog
from mcap_landmarks.stage import Connection

Panel = dict[str, object]
_ESTIMATE, _TRUTH = ("#d55e00", "#f0a35e"), ("#0072b2", "#7fb8d8")
"""Of x and y each: two hues that people who see no red or no green tell apart (Okabe and Ito 2008)."""
_GREY, _SCAN = "#9ca3afff", "#facc15ff"
_STATES = 5
"""The largest status of LandmarkMatch."""
_DRAWN_2D = (CompressedImage.ROS_TYPE, Image.ROS_TYPE, CompressedVideo.ROS_TYPE)
_FIELD_OF_VIEW_DEG = 45.0
_MARGIN, _SMALLEST_M = 1.25, 5.0


@dataclass(frozen=True, slots=True)
class Layout3d:
    """The 3D panel, and what of the log it leaves out, each with the reason."""

    panel: Panel
    left_out: Mapping[str, str]


def layout(view: ViewedLog, result: RunResult) -> tuple[dict[str, object], dict[str, str]]:
    """The layout of a log with its result, and the topics that are left out of the 3D panel with the reasons."""
    scene = _scene(view, result)
    beside = {f"Image!camera{number}": _image(camera, view) for number, camera in enumerate(_shown(view), 1)}
    plots = _plots(view)
    states = {"StateTransitions!status": _states()} if view.on(MATCH.topic) else {}
    panels = {**beside, "3D!map": scene.panel, **states, **plots}
    left = _stacked([*beside, *states], "column")
    below = _stacked([*plots], "row")
    middle = _split("3D!map", below, "column", 66)
    document: dict[str, object] = {
        "configById": panels,
        "globalVariables": {},
        "userNodes": {},
        "playbackConfig": {"speed": 1},
        "layout": middle if left is None else _split(left, middle, "row", 36),
    }
    return document, dict(scene.left_out)


def _shown(view: ViewedLog) -> list[ViewedCamera]:
    return [camera for camera in view.cameras if camera.image.read_as in _DRAWN_2D]


def _split(first: object, second: object, direction: str, percent: int) -> object:
    if second is None:
        return first
    return {"first": first, "second": second, "direction": direction, "splitPercentage": percent}


def _stacked(panels: Sequence[str], direction: str) -> object:
    """Panels of equal size in a row or a column, None of none."""
    if not panels:
        return None
    rest = _stacked(panels[1:], direction)
    return _split(panels[0], rest, direction, round(100 / len(panels)))


def _image(camera: ViewedCamera, view: ViewedLog) -> Panel:
    """An image with its annotations; those wait for each other where every image has one."""
    counts = [view.counts[one] for one in (camera.image, *camera.annotations)]
    mode: Panel = {
        "imageTopic": camera.image.topic,
        "annotations": {one.topic: {"visible": True} for one in camera.annotations},
        "synchronize": bool(camera.annotations) and len({*counts}) == 1,
    }
    if camera.info is not None:
        mode["calibrationTopic"] = camera.info.topic
    return {
        "cameraState": _camera(np.zeros(2), 20.0),
        "followMode": "follow-pose",
        "scene": {},
        "transforms": {},
        "topics": {},
        "layers": {},
        "imageMode": mode,
        "foxglovePanelTitle": camera.image.topic,
    }


def _scene(view: ViewedLog, result: RunResult) -> Layout3d:
    """The 3D panel from above, in the frame of the map: what transforms lead there is shown, in colours of its own."""
    frame, topics, left_out = view.fixed_frame, dict[str, Panel](), dict[str, str]()
    scans = {one for one in view.scans if one.read_as in (LaserScan.ROS_TYPE, PointCloud2.ROS_TYPE)}
    shown = [*view.of(MarkerArray, Path, PoseStamped, PoseWithCovarianceStamped), *sorted(scans, key=lambda c: c.topic)]
    for connection in shown:
        name = view.frame(connection)
        if view.leads(name):
            topics[connection.topic] = {"visible": True, **_style(connection)}
        else:
            left_out[connection.topic] = f"no transforms lead from {name or 'its frame'} to {frame}"
    spots = [result.trajectory.poses[:, :2]]
    spots += [scene.positions_xy for scene in (result.landmarks, result.drawn) if scene is not None]
    middle, span_m = _extent(np.vstack(spots))
    distance_m = _MARGIN * span_m / 2 / np.tan(np.deg2rad(_FIELD_OF_VIEW_DEG / 2))
    panel: Panel = {
        "cameraState": _camera(middle, float(distance_m)),
        "followMode": "follow-none",
        "followTf": frame,
        "scene": {"transforms": {"showLabel": False, "axisScale": 0.5}, "labelScaleFactor": 1},
        "transforms": {},
        "topics": topics,
        "layers": {"grid": _grid(frame, middle, span_m)},
        "imageMode": {},
        "foxglovePanelTitle": "Map",
    }
    return Layout3d(panel, left_out)


def _extent(spots_xy: np.ndarray) -> tuple[np.ndarray, float]:
    """The middle of some positions (N, 2) and their larger extent in metres."""
    known = spots_xy[np.isfinite(spots_xy).all(axis=1)]
    if not len(known):
        return np.zeros(2), _SMALLEST_M
    low, high = known.min(axis=0), known.max(axis=0)
    return (low + high) / 2, max(float((high - low).max()), _SMALLEST_M)


def _camera(middle_xy: np.ndarray, distance_m: float) -> Panel:
    """From above and a little behind: the map's x axis goes to the right, as on paper."""
    x, y = (round(float(value), 3) for value in middle_xy)
    return {
        "perspective": True,
        "distance": round(distance_m, 3),
        "phi": 25,
        "thetaOffset": 0,
        "target": [0, 0, 0],
        "targetOffset": [x, y, 0],
        "targetOrientation": [0, 0, 0, 1],
        "fovy": _FIELD_OF_VIEW_DEG,
        "near": 0.5,
        "far": 5000,
    }


def _grid(frame: str, middle_xy: np.ndarray, span_m: float) -> Panel:
    """A grid of metres under everything."""
    size_m = int(np.ceil(span_m * _MARGIN))
    return {
        "layerId": "foxglove.Grid",
        "instanceId": "grid",
        "label": "Grid",
        "visible": True,
        "frameLocked": True,
        "frameId": frame,
        "size": size_m,
        "divisions": min(size_m, 100),
        "lineWidth": 1,
        "color": "#6b728055",
        "position": [round(float(value)) for value in middle_xy] + [0],
        "rotation": [0, 0, 0],
        "order": 1,
    }


def _style(connection: Connection) -> Panel:
    topic, is_truth = connection.topic, connection.topic == TRUTH_POSE.topic
    if connection.read_as == LaserScan.ROS_TYPE:
        return {"colorMode": "flat", "flatColor": _SCAN, "pointSize": 3}
    if connection.read_as == PointCloud2.ROS_TYPE:
        return {"colorMode": "colormap", "colorField": "z", "colorMap": "turbo", "pointSize": 2}
    if connection.read_as == Path.ROS_TYPE:
        return {"type": "line", "lineWidth": 0.05, "gradient": [f"{_ESTIMATE[0]}ff", f"{_ESTIMATE[0]}ff"]}
    if connection.read_as == PoseWithCovarianceStamped.ROS_TYPE:
        return {
            "type": "arrow",
            "color": f"{_ESTIMATE[0]}ff",
            "arrowScale": [0.6, 0.08, 0.08],
            "showCovariance": topic == POSE_COVARIANCE.topic,
            "covarianceColor": f"{_ESTIMATE[0]}55",
        }
    if connection.read_as == PoseStamped.ROS_TYPE:
        colour = f"{_TRUTH[0]}ff" if is_truth else f"{_ESTIMATE[1]}ff"
        return {"type": "arrow", "color": colour, "arrowScale": [0.6, 0.08, 0.08]}
    return {}


def _plots(view: ViewedLog) -> dict[str, Panel]:
    """Positions beside the truth, their standard deviations, and how certain each bundle was."""
    position, sigma, found = list[Panel](), list[Panel](), dict[str, Panel]()
    estimate = POSE if view.on(POSE.topic) else MAP_POSE
    for channel, name, colours in ((estimate, "estimate", _ESTIMATE), (TRUTH_POSE, "truth", _TRUTH)):
        if view.on(channel.topic):
            base = f"{channel.topic}.pose.position"
            position += [_path(f"{base}.{axis}", f"{axis} {name}", c) for axis, c in zip("xy", colours, strict=True)]
    if view.on(POSE_COVARIANCE.topic):
        base, diagonal = f"{POSE_COVARIANCE.topic}.pose.covariance", zip("xy", (0, 7), _ESTIMATE, strict=True)
        sigma = [_path(f"{base}[{at}].@sqrt", f"sigma {axis}", colour) for axis, at, colour in diagonal]
    if position:
        found["Plot!position"] = _plot("Position [m]", position)
    if sigma:
        found["Plot!sigma"] = _plot("Standard deviation of the position [m]", sigma)
    if view.on(MATCH.topic):
        status = [_path(f"{MATCH.topic}.status", "status (0: localized)", _GREY)]
        found["Plot!status"] = _plot("Status", status) | {"minYValue": -0.5, "maxYValue": _STATES + 0.5}
    return found


def _path(value: str, label: str, colour: str) -> Panel:
    return {
        "value": value,
        "enabled": True,
        "timestampMethod": "receiveTime",
        "label": label,
        "color": colour,
        "showLine": True,
        "lineSize": 1.5,
    }


def _plot(title: str, paths: Sequence[Panel]) -> Panel:
    return {
        "paths": [*paths],
        "showLegend": True,
        "legendDisplay": "floating",
        "showPlotValuesInLegend": True,
        "showXAxisLabels": True,
        "showYAxisLabels": True,
        "isSynced": True,
        "xAxisVal": "timestamp",
        "sidebarDimension": 240,
        "foxglovePanelTitle": title,
    }


def _states() -> Panel:
    """The status of every bundle as a band; viewers name its values as LandmarkMatch's constants are called."""
    path = {"value": f"{MATCH.topic}.status", "timestampMethod": "receiveTime", "label": "status"}
    return {"paths": [path], "isSynced": True, "foxglovePanelTitle": "Status of every bundle"}
