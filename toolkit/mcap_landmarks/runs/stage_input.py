"""A log as one stage reads it: which connections, and the bundles of their messages in one pass."""

import contextlib
import copy
from collections.abc import Iterator, Mapping, Sequence
from itertools import chain
from typing import Any, Self

from mcap_landmarks.channels import CAMERA_IMAGE, CAMERA_INFO, DETECTIONS, ODOMETRY, TF_STATIC
from mcap_landmarks.errors import MessageError, RecordingError, UsageError
from mcap_landmarks.inspection.camera_images import CameraImages, first_calibrated, images_of
from mcap_landmarks.inspection.cameras import NO_CAMERAS, Cameras, info_frames
from mcap_landmarks.inspection.examination import Asked, Examined, Examiner
from mcap_landmarks.inspection.odometry_examination import ExaminedOdometry
from mcap_landmarks.inspection.time_offsets import OFFSET_ROLES
from mcap_landmarks.inspection.topic_roles import cameras_of, choose, message_type
from mcap_landmarks.messages.codec import M, Message, decode
from mcap_landmarks.messages.images import CameraInfo
from mcap_landmarks.progress import Progress
from mcap_landmarks.recording.layered_log import LayeredLog
from mcap_landmarks.recording.odometry_track import odometry_from
from mcap_landmarks.runs.bundles import Correction, Reading, Span, decoded, held_before, inputs_of, read_bundles
from mcap_landmarks.runs.thinning import Thinning, thin, thinned_before
from mcap_landmarks.stage import Bundle, Channel, Connection, RawMessage, Reduction, Stage

_EVERY_MESSAGE = Thinning()


class StageInput:
    """What a stage reads of a log (an `InputLog`); `reading` says what became of the messages.

    Raises:
        RecordingError: a channel that the stage requires is missing or has no messages, or is odometry that cannot be
            used.
        UsageError: several topics could be meant, or the one that was chosen is of another type.
    """

    def __init__(self, stage: Stage | Reduction, log: LayeredLog, span: Span, examiner: Examiner | None = None) -> None:
        self.path, self.channels, self.messages = log.path, log.channels, log.messages
        self.reading = Reading()
        self._log, self._span, self._reads = log, span, stage.reads
        self._inputs = inputs_of(log, stage.reads, stage.required, span.choice)
        self._primaries = [entry for entry, channel in self._inputs.items() if channel == stage.reads[0]]
        self.primary = self._primaries[0]
        cameras = cameras_of(log, span.choice) if {CAMERA_IMAGE, CAMERA_INFO} & {*self._inputs.values()} else NO_CAMERAS
        images, self._infos = self._images(), self._calibrated()
        self._correction = Correction(self._examined(examiner), self._frames_of(cameras), images, self._infos)
        refusal = self._odometry.refusal
        if refusal and ODOMETRY in stage.required:
            raise RecordingError(f"{self.path}: {refusal}")
        self.notes = (
            *cameras.notes(),
            *self._odometry.notes,
            *self._notes_of(images),
            *([f"goes on without odometry: {refusal}"] * bool(refusal)),
        )

    @property
    def count(self) -> int:
        """About how many bundles there will be."""
        return self._log.count(self._primaries, self._span.start_ns, self._span.end_ns)

    def first(self, channel: Channel[M]) -> M | None:
        """See `InputLog`."""
        for raw in self._log.messages([entry for entry, known in self._inputs.items() if known == channel]):
            with contextlib.suppress(MessageError):
                found = decode(message_type(channel, raw.connection), raw.data)
                message = odometry_from(found) if channel == ODOMETRY else found
                if isinstance(message, channel.message):
                    return message
        return None

    def bundles(
        self, progress: Progress, thinning: Thinning = _EVERY_MESSAGE, began: Mapping[str, Any] | None = None
    ) -> Iterator[Bundle]:
        """The bundles, without those that `thinning` leaves out; `progress` is told of each message that makes one.

        `began` is how far thinning had come before, as `thinned_before` tells.

        Raises:
            UsageError: messages are to be left out by motion, and there is no odometry.
        """
        self.reading.dropped.update(self._odometry.dropped)
        raws = chain(held_before(self._log, self._inputs, self._span.start_ns), self._raws(progress, thinning, began))
        return read_bundles(raws, self._inputs, self._reads, self.reading, self._correction, self._seeds())

    def by_frame(self) -> dict[str, Self]:
        """The same log for each of several cameras, whose images are primary there, by frame; none for one camera."""
        found = {}
        for connection in self._primaries:
            if connection in self._correction.frames:
                found[self._correction.frames[connection]] = one = copy.copy(self)
                one.primary = connection
        return found

    def times_ns(self) -> tuple[int, int] | None:
        """The first and the last log time that a message can have; None where there is none."""
        first, last = self._log.times_ns()
        if first is None or last is None:
            return None
        start_ns, end_ns = self.within(first, last + 1)
        return (start_ns, end_ns - 1) if start_ns < end_ns else None

    def within(self, start_ns: int, end_ns: int) -> tuple[int, int]:
        """The part of a stretch of log time that is read."""
        own_start, own_end = self._span.start_ns, self._span.end_ns
        return max(start_ns, own_start or 0), end_ns if own_end is None else min(end_ns, own_end)

    def damage(self) -> list[str]:
        """What the log lost by damage, as far as it was read."""
        return self._log.losses

    def close(self, damage: Sequence[str] | None = None) -> None:
        """Sum up what became of the messages, when all of them were read; by others, if they tell of its `damage`."""
        self.reading.close(self.damage() if damage is None else damage)

    def _images(self) -> dict[Connection, CameraImages]:
        """The images that the log's CameraInfos go with."""
        infos = [entry for entry, channel in self._inputs.items() if channel == CAMERA_INFO]
        return images_of(self._log, self._span.choice, infos) if infos else {}

    def _calibrated(self) -> dict[Connection, RawMessage]:
        """The first message with a focal length of each connection of CameraInfo that has one."""
        infos = [entry for entry, channel in self._inputs.items() if channel == CAMERA_INFO]
        found = {entry: first_calibrated(self._log, entry) for entry in infos}
        return {entry: raw for entry, raw in found.items() if raw is not None}

    def _notes_of(self, images: Mapping[Connection, CameraImages]) -> Iterator[str]:
        for entry, beside in images.items():
            raw = next(iter(self._log.messages([entry])), None)
            with contextlib.suppress(MessageError):
                yield from () if raw is None else beside.notes(entry.topic, decode(CameraInfo, raw.data))

    def _frames_of(self, used: Cameras) -> dict[Connection, str]:
        """The frames of several cameras, by connection; where none were chosen, as their CameraInfos tell them."""
        infos = [entry for entry, channel in self._inputs.items() if channel == CAMERA_INFO]
        frames, remaps = used.frames(), self._span.choice.remaps
        told = {entry: frames.get(remaps.get(entry.topic, entry.topic)) for entry in self._inputs}
        return {entry: frame for entry, frame in told.items() if frame is not None} or info_frames(self._log, infos)

    def _examined(self, examiner: Examiner | None) -> Examined | None:
        """What is known of stamps, frames and odometry; nothing where the stage looks at images alone."""
        if self._inputs[self.primary] == CAMERA_IMAGE:
            return None
        examiner = examiner or Examiner(self._span.start_ns, self._span.end_ns)
        made = {entry.connection for layer in self._log.layers if layer.record for entry in layer.channels}
        # Results were made of corrected stamps, but detections have their images'.
        offsets_ns = {
            connection: self._span.choice.offsets_ns.get(OFFSET_ROLES.get(channel, ""), 0)
            for connection, channel in self._inputs.items()
            if channel == DETECTIONS or connection not in made
        }
        return examiner.examine(self._log, Asked(self._inputs, self.primary, made, offsets_ns))

    @property
    def _odometry(self) -> ExaminedOdometry:
        examined = self._correction.examined
        return (examined.odometry if examined else None) or ExaminedOdometry(None)

    def _seeds(self) -> Iterator[tuple[Channel[Message], int, Message]]:
        """What holds from the start on although it was logged later: the first transforms, and CameraInfo."""
        examined, start_ns = self._correction.examined, self._span.start_ns or 0
        if examined is not None and examined.frames.first is not None:
            yield TF_STATIC, start_ns, examined.frames.first
        for connection, channel in self._inputs.items():
            raw = next(iter(self._log.messages([connection])), None) if channel == CAMERA_INFO else None
            raw = self._infos.get(connection, raw)
            if raw is not None:
                first = raw._replace(log_time_ns=start_ns)
                yield from decoded([first], self._inputs, Reading(), self._correction)

    def thinned_before(self, thinning: Thinning, times_ns: Sequence[int]) -> list[dict[str, Any]]:
        """How far thinning has come at each of some rising log times; see `thinning.thinned_before`.

        Raises:
            UsageError: see `bundles`.
        """
        odometry = self._followed(thinning)
        raws = self._log.messages({*self._primaries, *odometry}, self._span.start_ns, self._span.end_ns)
        return thinned_before(raws, self._primaries, odometry, thinning, times_ns)

    def _followed(self, thinning: Thinning) -> Sequence[Connection]:
        """The odometry that has a say in what is left out."""
        odometry = choose(self._log, ODOMETRY, self._span.choice) if thinning.by_motion else ()
        if thinning.by_motion and not odometry:
            raise UsageError(f"{self.path}: --every needs odometry, and there is none; use --image-rate")
        return odometry

    def _raws(self, progress: Progress, thinning: Thinning, began: Mapping[str, Any] | None) -> Iterator[RawMessage]:
        odometry = self._followed(thinning)
        raws = self._counted({*self._inputs, *odometry}, progress)
        if not thinning.options():
            return raws
        return thin(raws, self._primaries, odometry, thinning, self.reading.dropped, began)

    def _counted(self, wanted: set[Connection], progress: Progress) -> Iterator[RawMessage]:
        for raw in self._log.messages(wanted, self._span.start_ns, self._span.end_ns):
            yield raw
            if raw.connection in self._primaries:
                progress(1)
