"""One result as a page shows it, read from a log, a landmark database or a text of results."""

import contextlib
from collections.abc import Mapping
from dataclasses import dataclass, replace

from mcap_landmarks.channels import CAMERA_IMAGE, ODOMETRY
from mcap_landmarks.errors import RecordingError, ToolkitError, UsageError
from mcap_landmarks.evaluation.metrics import Evaluation, Reference, RunResult, evaluate
from mcap_landmarks.evaluation.pose_topics import read_poses
from mcap_landmarks.evaluation.read import is_database, read_run
from mcap_landmarks.evaluation.trajectory import Trajectory
from mcap_landmarks.inspection.topic_roles import Choice, choose
from mcap_landmarks.locations import Location
from mcap_landmarks.manifest import RUN
from mcap_landmarks.maps.database import read_manifest, read_map
from mcap_landmarks.messages.poses import Odometry
from mcap_landmarks.progress import Progress
from mcap_landmarks.recording.reader import Recording, open_recording
from mcap_landmarks.report.drawing import PAIRING, Drawing, Run, with_run
from mcap_landmarks.report.page.bundle_table import NO_BUNDLES, BundleTable, read_bundles
from mcap_landmarks.report.page.detector_statistics import DetectorStatistics, detector_statistics


@dataclass(frozen=True, slots=True, eq=False)
class PagedResult:
    """Everything of one result but its single bundles: `name` is what the page calls it, `path` where it lies.

    `is_log` says whether there are bundles to look at one by one, `has_images` whether these can have pictures;
    `odometry` is the path as the wheels tell it, in its own frame; `manifest` are entries of JSON text.
    """

    name: str
    path: Location
    run: RunResult
    drawing: Drawing
    evaluation: Evaluation
    bundles: BundleTable = NO_BUNDLES
    odometry: Trajectory | None = None
    detector: DetectorStatistics | None = None
    manifest: Mapping[str, str] | None = None
    is_log: bool = False
    has_images: bool = False
    has_truth: bool = False
    losses: tuple[str, ...] = ()

    @property
    def drawn(self) -> Run | None:
        """The poses of the run beside the truth, None if it has neither."""
        return self.drawing.runs[0] if self.drawing.runs else None


def read_result(
    path: Location,
    name: str,
    reference: Reference | None = None,
    *,
    aligned: bool = False,
    is_brief: bool = False,
    progress: Progress | None = None,
) -> PagedResult:
    """The result in a file; `reference` is the truth that counts before its own, `aligned` moves it onto the truth.

    What is brief has neither odometry nor statistics of the detector.

    Raises:
        ToolkitError: the file cannot be read, has nothing to show, or cannot be aligned.
    """
    run, own, losses = read_run(path, progress)
    truth = (reference or Reference()).over(own)
    is_map, is_text = is_database(path), path.suffix == ".txt"
    groups = read_map(path).groups if is_map else ()
    try:
        drawing = with_run(Drawing(), name, run, truth, groups, aligned=aligned)
        evaluation = evaluate(run, truth, PAIRING, aligned=aligned)
    except UsageError as error:
        raise UsageError(f"{path}: {error}") from error
    result = PagedResult(name, path, run, drawing, evaluation, losses=tuple(losses))
    result = replace(result, has_truth=truth.trajectory is not None or truth.objects is not None)
    if is_map:
        result = replace(result, manifest=read_manifest(path))
    elif not is_text:
        result = _with_log(result, is_brief=is_brief)
    if not len(result.bundles) and drawing.landmarks is None and not len(run.trajectory):
        raise RecordingError(f"{path}: holds no results to show; run localize, map or another stage on it first")
    return result


def _with_log(result: PagedResult, *, is_brief: bool) -> PagedResult:
    """The result with what else its log tells."""
    times_ns = result.run.trajectory.time_ns
    with open_recording(result.path) as recording:
        return replace(
            result,
            bundles=read_bundles(recording, times_ns if result.run.continuous else times_ns[:0]),
            odometry=None if is_brief else _odometry(recording),
            detector=None if is_brief else detector_statistics(recording),
            manifest=recording.metadata.get(RUN),
            is_log=True,
            has_images=_has_images(recording),
        )


def _has_images(recording: Recording) -> bool:
    try:
        return bool(choose(recording, CAMERA_IMAGE, Choice()))
    except UsageError:  # there are several cameras
        return True


def _odometry(recording: Recording) -> Trajectory | None:
    """The path of the one odometry topic; None where there is none, or several."""
    with contextlib.suppress(ToolkitError):
        for connection in choose(recording, ODOMETRY, Choice()):
            if connection.read_as == Odometry.ROS_TYPE:
                return read_poses(recording.path, connection.topic).trajectory
    return None
