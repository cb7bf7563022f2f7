"""Hypothesis strategies for every message dataclass."""

import numpy as np
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from mcap_landmarks.messages.annotations import ImageAnnotations, Label, Outline
from mcap_landmarks.messages.boxes import Boxes
from mcap_landmarks.messages.clustered_cloud import ClusteredCloud
from mcap_landmarks.messages.detections import Detections
from mcap_landmarks.messages.images import CameraInfo, CompressedImage, Image, Region
from mcap_landmarks.messages.markers import Marker, MarkerArray, MarkerShape
from mcap_landmarks.messages.match import Condition, LandmarkMatch, Status
from mcap_landmarks.messages.numbers import UInt8
from mcap_landmarks.messages.points import PointCloud2
from mcap_landmarks.messages.poses import Odometry, Path, PoseStamped, PoseWithCovarianceStamped
from mcap_landmarks.messages.scan import LaserScan, MultiEchoLaserScan
from mcap_landmarks.messages.scan_objects import ScanObjects
from mcap_landmarks.messages.scene import SceneObjects
from mcap_landmarks.messages.transforms import TFMessage, Transform
from mcap_landmarks.messages.velocities import SceneVelocities

number = st.floats(-1e6, 1e6)
anything = st.floats(width=64)
stamp = st.integers(0, 2**31 * 10**9 - 1)
text = st.text(st.characters(exclude_characters="\0", exclude_categories=["Cs"]), max_size=12)
color = st.tuples(*[st.floats(0, 1, width=32)] * 4)


def vector(*shape: int, elements: st.SearchStrategy[float] = anything) -> st.SearchStrategy[np.ndarray]:
    return arrays(np.float64, shape, elements=elements)


scan_ranges = st.integers(0, 20).flatmap(lambda n: arrays(np.float32, (n,), elements=st.floats(width=32)))
cloud_points = st.integers(0, 5).flatmap(lambda n: arrays(np.float32, (n, 3), elements=st.floats(width=32)))
single = st.floats(width=32, allow_nan=False)
hypotheses = st.lists(st.tuples(text, number), max_size=3).map(tuple)
pose_stamped = st.builds(PoseStamped, stamp, text, vector(3), vector(4))
transform = st.builds(Transform, stamp, text, text, vector(3), vector(4))


@st.composite
def boxes(draw: st.DrawFn, n: int) -> Boxes | None:
    """As many boxes, or none: what has no height is no box."""
    if n == 0 or draw(st.booleans()):
        return None
    sizes = draw(vector(n, 3, elements=st.floats(0.1, 100)))
    return Boxes(draw(vector(n, 3)), sizes, np.zeros(n))


@st.composite
def clustered_cloud(draw: st.DrawFn) -> ClusteredCloud:
    points = draw(cloud_points)
    heights = draw(arrays(np.float32, len(points), elements=st.floats(width=32)))
    return ClusteredCloud(draw(stamp), draw(text), points, heights, draw(arrays(np.int32, len(points))))


@st.composite
def scene_objects(draw: st.DrawFn) -> SceneObjects:
    n = draw(st.integers(0, 4))
    classes = draw(st.lists(hypotheses.filter(len), min_size=n, max_size=n).map(tuple))
    ids = draw(st.lists(text, min_size=n, max_size=n).map(tuple))
    around = draw(boxes(n))
    radii = around.sizes_m[:, 0] / 2 if around else draw(vector(n, elements=st.floats(0, 100)))
    places = draw(vector(n, 2))
    places[~places.any(axis=1)] = 1.0  # where the pose is all zero the box counts: no object is where the robot is
    return SceneObjects(draw(stamp), draw(text), ids, classes, places, draw(vector(n, 2, 2)), radii, around)


@st.composite
def scene_velocities(draw: st.DrawFn) -> SceneVelocities:
    ids = draw(st.lists(text, max_size=4).map(tuple))
    n = len(ids)
    return SceneVelocities(draw(stamp), draw(text), ids, draw(vector(n, 2)), draw(vector(n, 2, 2)), draw(vector(n)))


@st.composite
def scan_objects(draw: st.DrawFn) -> ScanObjects:
    classes = draw(st.lists(hypotheses, max_size=4).map(tuple))
    ids = draw(st.lists(text, min_size=len(classes), max_size=len(classes)).map(tuple))
    points = tuple(draw(vector(len(options), 2)) for options in classes)
    spreads = tuple(draw(vector(len(options), 2, 2)) for options in classes)
    around = draw(boxes(len(classes)))
    extents = around.sizes_m[:, 0] if around else draw(vector(len(classes)))
    return ScanObjects(draw(stamp), draw(text), ids, classes, points, spreads, extents, around)


@st.composite
def detections(draw: st.DrawFn) -> Detections:
    n = draw(st.integers(0, 4))
    found = draw(st.lists(hypotheses, min_size=n, max_size=n).map(tuple))
    ids = draw(st.lists(text, min_size=n, max_size=n).map(tuple))
    corner, size = draw(vector(n, 2, elements=st.integers(0, 999))), draw(vector(n, 2, elements=st.integers(0, 999)))
    return Detections(draw(stamp), draw(text), ids, found, np.hstack([corner, corner + size]))


@st.composite
def annotations(draw: st.DrawFn) -> ImageAnnotations:
    outline = st.builds(Outline, vector(3, 2), color, number)
    label = st.builds(Label, st.tuples(number, number), text, number, color, color)
    outlines = draw(st.lists(outline, min_size=1, max_size=2).map(tuple))
    return ImageAnnotations(draw(stamp), outlines, draw(st.lists(label, max_size=2).map(tuple)))


marker = st.builds(
    Marker, text, st.integers(0, 9), st.sampled_from(MarkerShape), vector(3), vector(3), color, text, vector(2, 3)
)
match = st.builds(
    LandmarkMatch,
    stamp,
    text,
    st.sampled_from(Status),
    st.lists(text, max_size=3).map(tuple),
    st.lists(text, max_size=3).map(tuple),
    vector(3),
    st.lists(text, max_size=3).map(tuple),
    vector(2),
    number,
    number,
    st.integers(0, 99),
    st.integers(0, 99),
    st.lists(st.builds(Condition, text, number, number, st.booleans()), max_size=3).map(tuple),
)
laser_scan = st.builds(LaserScan, stamp, text, *[single] * 7, scan_ranges, scan_ranges)
MESSAGES = st.one_of(
    pose_stamped,
    st.builds(PoseWithCovarianceStamped, stamp, text, vector(3), vector(4), vector(6, 6)),
    st.builds(Path, stamp, text, st.lists(pose_stamped, max_size=3).map(tuple)),
    st.builds(Odometry, stamp, text, text, vector(3), vector(4), vector(6, 6), vector(3), vector(3), vector(6, 6)),
    st.builds(TFMessage, st.lists(transform, max_size=3).map(tuple)),
    laser_scan,
    st.builds(MultiEchoLaserScan, laser_scan),
    st.builds(PointCloud2, stamp, text, cloud_points),
    clustered_cloud(),
    scene_velocities(),
    st.builds(CompressedImage, stamp, text, text, st.binary(max_size=30)),
    st.builds(
        Image, stamp, text, st.integers(0, 9), st.integers(0, 9), text, st.booleans(), st.integers(0, 9), st.binary()
    ),
    st.builds(
        CameraInfo,
        stamp,
        text,
        st.integers(0, 9),
        st.integers(0, 9),
        text,
        vector(5),
        vector(3, 3),
        vector(3, 3),
        vector(3, 4),
        st.tuples(st.integers(0, 9), st.integers(0, 9)),
        st.builds(Region, *[st.integers(0, 9)] * 4, st.booleans()),
    ),
    scene_objects(),
    scan_objects(),
    detections(),
    annotations(),
    st.builds(MarkerArray, stamp, text, st.lists(marker, min_size=1, max_size=3).map(tuple), st.booleans()),
    st.builds(MarkerArray, stamp, text, st.just(()), st.just(True)),
    match,
    st.builds(UInt8, st.integers(0, 255)),
)
