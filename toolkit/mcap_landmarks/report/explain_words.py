"""What an explanation says of the sensors: what was detected, clustered and fused, and what came to nothing."""

from collections import Counter
from functools import reduce
from operator import or_

from mcap_landmarks.evaluation.explain import Situation
from mcap_landmarks.geometry.se2 import Array
from mcap_landmarks.report.explain_reading import SensorData


def sensed_lines(situation: Situation, view: SensorData) -> list[str]:
    """A line for each step up to the scene, and one for each box that is no object."""
    lines = [
        f"detected: {_detected(situation)}",
        f"clustered: {_clustered(situation, view)}",
        f"fused: {_fused(situation, view)}",
    ]
    for one in view.lost or ():
        image = f" of {one.camera}" if len(situation.detections) > 1 else ""
        lines.append(f"  {one.name} {one.score:.2f} about {_middle(one.box_xyxy)}{image} is no object: {one.reason}")
    return lines


def beside_the_scan(stamp_ns: int, scan_ns: int) -> str:
    """When something was, as seen from the scan."""
    apart_ms = round((stamp_ns - scan_ns) / 1e6)
    return f"{abs(apart_ms)} ms {'before' if apart_ms < 0 else 'after'} the scan" if apart_ms else "at the scan's time"


def _detected(situation: Situation) -> str:
    told = []
    for found in situation.detections:
        names = ", ".join(f"{name} {score:.2f}" for options in found.hypotheses for name, score in options[:1])
        when = beside_the_scan(found.stamp_ns, situation.stamp_ns)
        image = f"image of {found.frame_id}" if len(situation.detections) > 1 else "image"
        told.append(f"{names or 'no object'}, in the {image} {when}")
    return "; ".join(told) or "nothing that the log tells"


def _middle(box_xyxy: Array) -> str:
    x1, y1, x2, y2 = box_xyxy.tolist()
    return f"pixel {(x1 + x2) / 2:.0f}, {(y1 + y2) / 2:.0f}"


def _clustered(situation: Situation, view: SensorData) -> str:
    found, cloud = situation.scan_objects, view.cloud
    if cloud is not None:
        count = len({*cloud.clusters.tolist()})
        small = "" if found is None else f", {len(found)} of them small enough to be objects"
        return f"{len(cloud.clusters)} points above the ground, in {count} clusters{small}"
    if found is None:
        return "nothing that the log tells"
    bare = sum(options[0][0] == "" for options in found.hypotheses if options)
    return f"{len(found)} clusters, {bare} of them rather none of the known shapes"


def _fused(situation: Situation, view: SensorData) -> str:
    scene = situation.scene
    if scene is None:
        return "no scene objects at this time"
    text = f"{len(scene)} objects"
    if view.lost:
        text += f"; detected, but no object: {len(view.lost)}, as follows"
    elif view.lost is None and situation.detections:
        seen = [Counter(options[0][0] for options in one.hypotheses if options) for one in situation.detections]
        # What two cameras see may be the same.
        left = reduce(or_, seen) - Counter(scene.classes)
        if left:
            text += f"; detected, but no object: {', '.join(f'{count} {name}' for name, count in sorted(left.items()))}"
    if situation.landmarks is not None:
        unknown = sorted(set(scene.classes) - set(situation.landmarks.classes))
        if unknown:
            text += f"; classes that the map lacks: {', '.join(unknown)}"
    return text
