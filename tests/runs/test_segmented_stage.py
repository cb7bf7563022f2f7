"""A log in segments gives the same bytes as in one piece, wherever it is cut and whatever is wrong with its images."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import pytest
from mcap_landmarks.channels import CAMERA_IMAGE
from mcap_landmarks.errors import RecordingError
from mcap_landmarks.manifest import RUN
from mcap_landmarks.messages.images import CompressedImage
from mcap_landmarks.recording.reader import open_recording
from mcap_landmarks.runs.bundles import Span
from mcap_landmarks.runs.pipeline import LogRun, run_stages
from mcap_landmarks.runs.plan import Request
from mcap_landmarks.runs.run_options import RunOptions
from mcap_landmarks.runs.segment_tasks import Segments, SegmentTask
from mcap_landmarks.runs.segment_worker import run_segment
from mcap_landmarks.stage import Stamped

from tests.cli.logs import write
from tests.cli.test_several_cameras import images, messages
from tests.runs.chain import STEP_NS, by_others, raw_log, raw_messages, two_posts

COUNT = 20
BROKEN = b"\xff\xd8 cut"


@dataclass(slots=True)
class Here:
    """Segments one after the other in this process, from the last to the first; it stops before the `stop`-th."""

    stop: int | None = None
    made: list[Path] = field(default_factory=list)

    def __call__(self, tasks: Sequence[SegmentTask]) -> Iterator[SegmentTask]:
        for task in reversed(tasks):
            if len(self.made) == self.stop:
                raise RecordingError("interrupted")
            run_segment(task.text, task.target)
            self.made.append(task.target)
            yield task


@pytest.fixture(scope="module")
def model(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return two_posts(tmp_path_factory.mktemp("model") / "model.onnx")


@pytest.fixture(scope="module")
def log(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return raw_log(tmp_path_factory.mktemp("log") / "log.mcap", COUNT)


def asked(log: Path, model: Path, **options: object) -> Request:
    return RunOptions(files={"model": model}, **options).requests([log])[0]  # type: ignore[arg-type] # any option


def detected(request: Request, output: Path, cut: Here | None = None, length_ns: int = STEP_NS * 5) -> LogRun:
    if cut is not None:
        request = replace(request, segments=Segments(length_ns, cut))
    return run_stages(request, output, ["detect"], "detect")


def same(request: Request, folder: Path, length_ns: int = STEP_NS * 5) -> tuple[LogRun, Here]:
    """The run in one piece, which one in segments agreed with."""
    cut = Here()
    whole = detected(request, folder / "whole.mcap")
    parts = detected(request, folder / "parts.mcap", cut, length_ns)
    assert (folder / "parts.mcap").read_bytes() == (folder / "whole.mcap").read_bytes()
    assert parts.outcome == whole.outcome
    assert (parts.notes, parts.losses) == (whole.notes, whole.losses)
    assert sorted(path.name for path in folder.iterdir() if path.name.startswith(".")) == []
    return whole, cut


@pytest.mark.parametrize(("steps", "segments"), [(1, 21), (7.3, 3), (100, 0)])
def test_bytes_are_the_same_wherever_it_is_cut(
    log: Path, model: Path, tmp_path: Path, steps: float, segments: int
) -> None:
    """Also what joins the segments: it is what one process leaves when it is killed before the output."""
    whole, cut = same(asked(log, model), tmp_path, round(STEP_NS * steps))
    assert len(cut.made) == segments
    assert whole.outcome.bundles == COUNT


def test_cuts_do_not_depend_on_where_the_log_begins(log: Path, model: Path, tmp_path: Path) -> None:
    request = asked(log, model)
    later = replace(request, span=Span(request.span.choice, 3 * STEP_NS + 1, 18 * STEP_NS))
    _, cut = same(later, tmp_path)
    _, all_of_it = same(replace(request, overwrite=True), tmp_path)
    bounds = [{path.stem.rpartition(".")[2] for path in one.made} for one in (cut, all_of_it)]
    assert bounds[0] < bounds[1]


@pytest.mark.parametrize(
    "thinning",
    [{"image_rate": 2.1}, {"every": "0.05m"}, {"every": "0.03m,5deg", "image_rate": 3.0}],
    ids=["rate", "motion", "both"],
)
def test_thinning_goes_on_over_the_cuts(log: Path, model: Path, tmp_path: Path, thinning: dict[str, object]) -> None:
    whole, _ = same(asked(log, model, **thinning), tmp_path, STEP_NS * 3)
    assert 3 < whole.outcome.bundles < COUNT


def spoilt(path: Path, which: Sequence[int]) -> Path:
    """The log with some images that are cut short."""
    times_ns = {(i + 1) * STEP_NS for i in which}
    return write(
        path,
        [
            Stamped(CAMERA_IMAGE, stamped.log_time_ns, CompressedImage(stamped.log_time_ns, "camera", "jpeg", BROKEN))
            if stamped.channel == CAMERA_IMAGE and stamped.log_time_ns in times_ns
            else stamped
            for stamped in raw_messages(COUNT)
        ],
    )


def test_losses_add_up(model: Path, tmp_path: Path) -> None:
    """Where all images of a segment are damaged, too: the whole log has others."""
    whole, _ = same(asked(spoilt(tmp_path / "log.mcap", [2, 5, 6, 7, 8, 9, 17]), model), tmp_path, STEP_NS * 5)
    assert whole.outcome.unreadable == 7
    assert whole.losses[1] == f"{CAMERA_IMAGE.topic}: 7 messages could not be decoded in all"


def test_a_log_of_damaged_images_is_refused_alike(model: Path, tmp_path: Path) -> None:
    request = asked(spoilt(tmp_path / "log.mcap", range(COUNT)), model)
    told = []
    for cut in (None, Here()):
        with pytest.raises(RecordingError, match="none of 20 images could be read") as refusal:
            detected(request, tmp_path / "out.mcap", cut)
        told.append(str(refusal.value))
    assert told[0] == told[1]


@pytest.mark.parametrize("chunk_bytes", [1 << 20, 6000], ids=["one chunk", "many chunks"])
def test_logs_of_others_are_cut_alike(log: Path, model: Path, tmp_path: Path, chunk_bytes: int) -> None:
    """All topics lie in one chunk, which every segment reads, or in some, of which one is damaged."""
    mixed = by_others(log, tmp_path / "mixed.mcap", chunk_bytes=chunk_bytes)
    is_damaged = chunk_bytes < 1 << 20
    if is_damaged:
        data = bytearray(mixed.read_bytes())
        data[len(data) // 2] ^= 0xFF
        mixed.write_bytes(data)
    whole, _ = same(asked(mixed, model), tmp_path, STEP_NS * 3)
    assert (whole.outcome.bundles < COUNT) is is_damaged
    assert any("is damaged" in loss for loss in whole.losses) is is_damaged


def test_several_cameras_keep_their_topics(model: Path, tmp_path: Path) -> None:
    log = write(tmp_path / "log.mcap", messages("front", "left"))
    request = asked(log, model, image=(images("front"), images("left")))
    same(request, tmp_path, STEP_NS * 3)
    with open_recording(tmp_path / "parts.mcap") as recording:
        assert sum("annotations" in entry.connection.topic for entry in recording.channels) == 2


def test_finished_segments_are_taken_again_after_an_interruption(log: Path, model: Path, tmp_path: Path) -> None:
    request, first, second = asked(log, model), Here(stop=3), Here()
    with pytest.raises(RecordingError, match="interrupted"):
        detected(request, tmp_path / "out.mcap", first)
    assert not (tmp_path / "out.mcap").exists()
    damaged = first.made[1]
    damaged.write_bytes(damaged.read_bytes()[: damaged.stat().st_size // 2])
    detected(request, tmp_path / "out.mcap", second)
    assert first.made[0] not in second.made
    assert damaged in second.made
    assert len({*first.made, *second.made}) == 5
    detected(request, tmp_path / "whole.mcap")
    assert (tmp_path / "out.mcap").read_bytes() == (tmp_path / "whole.mcap").read_bytes()
    assert list(tmp_path.glob(".*")) == []


def test_a_log_that_changed_meanwhile_is_refused(log: Path, model: Path, tmp_path: Path) -> None:
    def swapped(tasks: Sequence[SegmentTask]) -> Iterator[SegmentTask]:
        other = raw_log(tmp_path / "log.mcap", COUNT + 1)
        run_segment(tasks[0].text.replace(str(log), str(other)), tasks[0].target)
        yield tasks[0]

    request = replace(asked(log, model), segments=Segments(STEP_NS * 5, swapped))
    with pytest.raises(RecordingError, match="changed since the log was cut into segments"):
        run_stages(request, tmp_path / "out.mcap", ["detect"], "detect")


def test_what_a_worker_leaves_is_no_result_of_its_own(log: Path, model: Path, tmp_path: Path) -> None:
    """A part has no manifest: no run takes it for the results of the log."""
    first = Here(stop=1)
    with pytest.raises(RecordingError, match="interrupted"):
        detected(asked(log, model), tmp_path / "out.mcap", first)
    with open_recording(first.made[0]) as part:
        assert RUN not in part.metadata
