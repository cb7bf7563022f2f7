"""CameraInfo as that of the images beside it: sizes, K and P of their pixels instead of the full sensor's."""

from dataclasses import replace

import numpy as np

from mcap_landmarks.channels import CAMERA_INFO, DETECTIONS
from mcap_landmarks.errors import RecordingError
from mcap_landmarks.messages.images import CameraInfo, Region

Size = tuple[int, int]
"""Width and height in pixels."""

NO_INFO = (
    f"there is no {CameraInfo.ROS_TYPE} for the camera of {DETECTIONS.topic}; record the camera's, or read another "
    f"topic as it with --remap TOPIC={CAMERA_INFO.topic}"
)
"""What is said where nothing tells what pixels are directions of."""

_REMEDY = (
    "record the CameraInfo that belongs to these images, or choose other images with --image TOPIC, another CameraInfo "
    "with --remap"
)
_OFF_CENTRE = 0.25
"""Principal points of lenses are no farther from an image's middle than such a share of its size."""


def in_image(info: CameraInfo, image_px: Size | None = None) -> CameraInfo:
    """A CameraInfo whose sizes, K and P are of the image's pixels, without binning and region.

    As ROS defines it (sensor_msgs/CameraInfo): pixel = (pixel of the full sensor - offset of the region) / binning.
    Where the size of the images is known it decides: drivers that bin often give sizes, K and P of the binned image,
    and tell the binning nevertheless.

    Raises:
        RecordingError: the images are of another size than either; names both and the remedy.
    """
    full, region, bins = (info.width_px, info.height_px), info.region, _bins(info)
    shown = (region.width_px or full[0], region.height_px or full[1])
    if not all(full):
        whole = _scaled(info, bins, None)
        return whole if image_px is None else _without_size(whole, image_px)
    fits = region.x_px + shown[0] <= full[0] and region.y_px + shown[1] <= full[1]
    if fits and (image_px is None or _is_part(image_px, shown, bins)):
        return _scaled(info, bins, image_px)
    if image_px == full:
        return replace(info, binning=(0, 0), region=Region())
    wrong = "its region does not lie within" if image_px is None else f"the images are of {image_px[0]} x {image_px[1]}"
    raise RecordingError(f"the CameraInfo is of {_said(info, shown, bins)}, but {wrong}; {_REMEDY}")


def _bins(info: CameraInfo) -> Size:
    return max(info.binning[0], 1), max(info.binning[1], 1)


def _said(info: CameraInfo, shown: Size, bins: Size) -> str:
    """What a CameraInfo says of sizes, in words."""
    said = f"{info.width_px} x {info.height_px} pixels"
    if info.region != Region():
        said += f", with a region of {shown[0]} x {shown[1]} at {info.region.x_px}, {info.region.y_px}"
    if bins != (1, 1):
        said += f", of which binning {bins[0]} x {bins[1]} leaves {shown[0] // bins[0]} x {shown[1] // bins[1]}"
    return said


def _is_part(image_px: Size, shown: Size, bins: Size) -> bool:
    """Whether an image is what binning leaves: what is left over at the edge may be a pixel or none."""
    return all(abs(image - whole / one) < 1 for image, whole, one in zip(image_px, shown, bins, strict=True))


def _scaled(info: CameraInfo, bins: Size, image_px: Size | None) -> CameraInfo:
    """A CameraInfo of the part of the sensor that is read out, as the standard has it."""
    region = info.region
    if bins == (1, 1) and region == Region():
        return info
    width, height = region.width_px or info.width_px, region.height_px or info.height_px
    to_image = np.array([[1.0, 0.0, -region.x_px], [0.0, 1.0, -region.y_px], [0.0, 0.0, 1.0]])
    to_image[:2] /= np.array(bins, dtype=np.float64)[:, None]
    width, height = image_px or (width // bins[0], height // bins[1])
    return replace(
        info,
        width_px=width,
        height_px=height,
        intrinsics=to_image @ info.intrinsics,
        projection=to_image @ info.projection,
        binning=(0, 0),
        region=Region(),
    )


def _without_size(info: CameraInfo, image_px: Size) -> CameraInfo:
    """A CameraInfo that says no size, as of images that its principal point is about the middle of."""
    width, height = image_px
    middle = info.intrinsics[:2, 2]
    if not (np.abs(middle / [width, height] - 0.5) <= _OFF_CENTRE).all() and info.intrinsics[0, 0] > 0:
        raise RecordingError(
            f"the CameraInfo says no size, and its principal point {middle[0]:.6g}, {middle[1]:.6g} is not that of the "
            f"images of {width} x {height}; {_REMEDY}"
        )
    return replace(info, width_px=width, height_px=height, binning=(0, 0), region=Region())
