"""A log before a run: its own messages, apart from the results that stages left in it."""

from collections.abc import Sequence

from mcap_landmarks.errors import UsageError
from mcap_landmarks.inspection.topic_roles import choose
from mcap_landmarks.manifest import narrowed
from mcap_landmarks.messages.codec import Message
from mcap_landmarks.moments import moment
from mcap_landmarks.recording.layered_log import Layer, LayeredLog, own_layer, result_layers
from mcap_landmarks.recording.reader import Recording
from mcap_landmarks.runs.bundles import Span
from mcap_landmarks.runs.screened_log import ScreenedLog, videos_of
from mcap_landmarks.stage import Channel


class RecordedLog:
    """An open recording with its own messages apart from the results that stages left in it.

    Raises:
        UsageError: nothing of it lies in the time span.
    """

    def __init__(self, recording: Recording, span: Span) -> None:
        _check_span(recording, span)
        self.path = recording.path
        self.recording = recording
        self.own, self.results = own_layer(recording), result_layers(recording)
        self.fingerprint = narrowed(recording.fingerprint(), start_ns=span.start_ns, end_ns=span.end_ns)
        self.choice = span.choice
        self._videos = videos_of(recording, span.choice)

    @property
    def has_videos(self) -> bool:
        """Whether some images build on those before them."""
        return bool(self._videos)

    def without_results(self) -> LayeredLog:
        """Its own messages."""
        return self.layered([self.own])

    def layered(self, layers: Sequence[Layer]) -> LayeredLog:
        """Some layers as a stage reads them."""
        return ScreenedLog(self.path, layers, self._videos) if self._videos else LayeredLog(self.path, layers)

    def has(self, channel: Channel[Message]) -> bool:
        """Whether the recording has messages of its own for a channel.

        Raises:
            UsageError: several topics could be meant.
        """
        own = self.without_results()
        counts = {entry.connection: entry.count for entry in own.channels}
        return sum(counts[connection] for connection in choose(own, channel, self.choice)) > 0


def _check_span(recording: Recording, span: Span) -> None:
    first, last = recording.start_ns, recording.end_ns
    if first is None or last is None:
        return
    if (span.start_ns or 0) > last or (span.end_ns is not None and span.end_ns <= first):
        raise UsageError(
            f"{recording.path}: no message lies between --start and --end; "
            f"the log lasts from {moment(first)} to {moment(last)}"
        )
