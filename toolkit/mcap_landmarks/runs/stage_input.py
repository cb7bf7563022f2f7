"""A log as one stage reads it: which connections, and the bundles of their messages in one pass."""

import copy
from collections.abc import Iterator
from itertools import chain
from typing import Self

from mcap_landmarks.channels import CAMERA_IMAGE, CAMERA_INFO, DETECTIONS, ODOMETRY
from mcap_landmarks.errors import UsageError
from mcap_landmarks.inspection.cameras import NO_CAMERAS, Cameras, info_frames
from mcap_landmarks.inspection.topic_roles import OFFSET_ROLES, cameras_of, choose
from mcap_landmarks.messages.codec import M
from mcap_landmarks.progress import Progress
from mcap_landmarks.recording.layered_log import LayeredLog
from mcap_landmarks.runs.bundles import Reading, Span, decoded, held_before, inputs_of, read_bundles
from mcap_landmarks.runs.thinning import Thinning, thin
from mcap_landmarks.stage import Bundle, Channel, Connection, RawMessage, Reduction, Stage

_EVERY_MESSAGE = Thinning()


class StageInput:
    """What a stage reads of a log (an `InputLog`); `reading` says what became of the messages.

    Raises:
        RecordingError: a channel that the stage requires is missing or has no messages.
        UsageError: several topics could be meant, or the one that was chosen is of another type.
    """

    def __init__(self, stage: Stage | Reduction, log: LayeredLog, span: Span) -> None:
        self.path, self.channels, self.messages = log.path, log.channels, log.messages
        self.reading = Reading()
        self._log, self._span, self._reads = log, span, stage.reads
        self._inputs = inputs_of(log, stage.reads, stage.required, span.choice)
        self._primaries = [entry for entry, channel in self._inputs.items() if channel == stage.reads[0]]
        self.primary = self._primaries[0]
        cameras = cameras_of(log, span.choice) if {CAMERA_IMAGE, CAMERA_INFO} & {*self._inputs.values()} else NO_CAMERAS
        self.notes, self._frames = cameras.notes(), self._frames_of(cameras)
        self._offsets_ns = self._offsets()

    @property
    def count(self) -> int:
        """About how many bundles there will be."""
        return self._log.count(self._primaries, self._span.start_ns, self._span.end_ns)

    def first(self, channel: Channel[M]) -> M | None:
        """See `InputLog`."""
        connections = [entry for entry, known in self._inputs.items() if known == channel]
        raws = self._log.messages(connections)
        messages = decoded(raws, self._inputs, Reading(), offsets_ns=self._offsets_ns)
        return next((message for _, _, message in messages if isinstance(message, channel.message)), None)

    def bundles(self, progress: Progress, thinning: Thinning = _EVERY_MESSAGE) -> Iterator[Bundle]:
        """The bundles, without those that `thinning` leaves out; `progress` is told of each message that makes one.

        Raises:
            UsageError: messages are to be left out by motion, and there is no odometry.
        """
        raws = chain(held_before(self._log, self._inputs, self._span.start_ns), self._raws(progress, thinning))
        return read_bundles(raws, self._inputs, self._reads, self.reading, self._frames, self._offsets_ns)

    def by_frame(self) -> dict[str, Self]:
        """The same log for each of several cameras, whose images are primary there, by frame; none for one camera."""
        found = {}
        for connection in self._primaries:
            if connection in self._frames:
                found[self._frames[connection]] = one = copy.copy(self)
                one.primary = connection
        return found

    def close(self) -> None:
        """Sum up what became of the messages, when all of them were read."""
        self.reading.close(self._log.losses)

    def _frames_of(self, used: Cameras) -> dict[Connection, str]:
        """The frames of several cameras, by connection; where none were chosen, as their CameraInfos tell them."""
        infos = [entry for entry, channel in self._inputs.items() if channel == CAMERA_INFO]
        frames, remaps = used.frames(), self._span.choice.remaps
        told = {entry: frames.get(remaps.get(entry.topic, entry.topic)) for entry in self._inputs}
        return {entry: frame for entry, frame in told.items() if frame is not None} or info_frames(self._log, infos)

    def _offsets(self) -> dict[Connection, int]:
        """What the user adds to stamps. Results were made of corrected ones, but detections have their images'."""
        made = {entry.connection for layer in self._log.layers if layer.record for entry in layer.channels}
        return {
            connection: self._span.choice.offsets_ns.get(OFFSET_ROLES.get(channel, ""), 0)
            for connection, channel in self._inputs.items()
            if channel == DETECTIONS or connection not in made
        }

    def _raws(self, progress: Progress, thinning: Thinning) -> Iterator[RawMessage]:
        odometry = choose(self._log, ODOMETRY, self._span.choice) if thinning.by_motion else ()
        if thinning.by_motion and not odometry:
            raise UsageError(f"{self.path}: --every needs odometry, and there is none; use --image-rate")
        raws = self._counted({*self._inputs, *odometry}, progress)
        return thin(raws, self._primaries, odometry, thinning, self.reading.dropped) if thinning.options() else raws

    def _counted(self, wanted: set[Connection], progress: Progress) -> Iterator[RawMessage]:
        for raw in self._log.messages(wanted, self._span.start_ns, self._span.end_ns):
            yield raw
            if raw.connection in self._primaries:
                progress(1)
