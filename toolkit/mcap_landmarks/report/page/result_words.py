"""What a page says of a result in words: the verdict, what the log is, what is missing and what to run."""

from collections.abc import Sequence

from mcap_landmarks.channels import DETECTIONS, MATCH, SCAN_OBJECTS, SCENE_OBJECTS
from mcap_landmarks.evaluation.metrics import frame_note
from mcap_landmarks.messages.match import Status
from mcap_landmarks.moments import moment
from mcap_landmarks.report.page.bundle_table import WORDS
from mcap_landmarks.report.page.paged_result import PagedResult
from mcap_landmarks.wording import counted

TIMINGS = (
    "How long the stages took is not known: a result holds no times of the clock, so that the same input gives the "
    "same bytes. What the run printed with --json has them: give it with --run FILE."
)
_LEGEND = (
    "thick line: the truth",
    "thin: the estimate",
    "dashed: odometry",
    "ellipses: 95 % regions",
    "rings: true objects",
)


def verdict(result: PagedResult) -> str:
    """What came of the run in two or three sentences."""
    return " ".join([*_counted(result), *_measured(result)])


def _counted(result: PagedResult) -> list[str]:
    figures, statuses = result.evaluation, result.evaluation["statuses"]
    count, landmarks = len(result.bundles), result.drawing.landmarks
    if statuses is not None:
        whole, localized = sum(statuses.values()), statuses["localized"]
        names = zip(list(Status)[1:], WORDS[1:], strict=False)
        failed = [
            f"{statuses[status.name.lower()]} {words}" for status, words in names if statuses[status.name.lower()]
        ]
        said = [f"{localized} of {counted(whole, 'bundle')} were localized ({share(localized, whole)})."]
        return [*said, f"The others: {', '.join(failed)}."] if failed else said
    if result.run.continuous and len(result.run.trajectory):
        made = "" if landmarks is None else f"a map of {counted(len(landmarks), 'landmark')} and "
        return [f"The run made {made}the path of {counted(len(result.run.trajectory), 'bundle')}."]
    if figures["localized"]:
        return [f"{counted(figures['localized'], 'position')} were computed."]
    if not count and landmarks is not None:
        classes = len(set(landmarks.classes))
        plural = "class" if classes == 1 else "classes"
        return [f"A map of {counted(len(landmarks), 'landmark')} of {classes} {plural}."]
    made = {DETECTIONS: "detections", SCAN_OBJECTS: "clusters", SCENE_OBJECTS: "objects"}.get(
        result.bundles.stage, "results"
    )
    return [f"{counted(count, 'bundle')} with {made}; none of them is localized yet."]


def _measured(result: PagedResult) -> list[str]:
    figures = result.evaluation
    position, false = figures["position"], figures["false"]["count"] or 0
    if not figures["scored"] or position["rmse_m"] is None:
        return []
    fit = " after one rigid fit" if figures["alignment"] else ""
    off = f"{metres(position['rmse_m'])} (RMSE), {metres(position['max_m'])} at most"
    said = f"Against the truth{fit} they are off by {off}."
    if not false:
        return [said, "None is false."]
    return [said, f"{round(false)} of {figures['scored']} are false: over 1 m or 20 degrees off."]


def about(result: PagedResult) -> str:
    """When the log was, how long, and with which program."""
    table, parts = result.bundles, []
    if len(table):
        start_ns, end_ns = int(table.stamps_ns[0]), int(table.stamps_ns[-1])
        parts += [f"{moment(start_ns)[:19]}Z", f"{duration((end_ns - start_ns) / 1e9)} from first to last bundle"]
    landmarks = result.drawing.landmarks
    if landmarks is not None:
        parts.append(f"map of {counted(len(landmarks), 'landmark')}")
    if result.detector is not None:
        parts.append(f"{counted(result.detector.images, 'image')} looked at")
    return " · ".join(parts)


def missing(result: PagedResult, losses: Sequence[str] = ()) -> list[str]:
    """A sentence for each thing that the page cannot show, with what to run."""
    name, said = result.path.name, [f"Not all of the file could be read: {loss}." for loss in losses]
    if not result.has_truth:
        said.append(
            f"There is no truth in {name}, so no error is measured; name a log or trajectory that has it with "
            "--reference."
        )
    elif not result.evaluation["scored"] and len(result.run.trajectory):
        said.append("No pose has a truth near enough in time, so no error is measured.")
    if not result.is_log:
        said.append("This file has no bundles to look at one by one: report the log with results to see them.")
        return said
    if not result.has_images:
        said.append(
            f"{name} holds no images, so bundles show none: the recording has none, or --results-only left them out."
        )
    if result.detector is None:
        said.append(f"{name} holds no detections; mcap-landmarks detect writes them.")
    if result.bundles.stage is not MATCH and not result.run.continuous:
        said.append(f"No bundle was matched: mcap-landmarks localize {name} --map MAP.db -o OUT.mcap does that.")
    if result.drawing.landmarks is None:
        said.append("There is no map in the log, so no landmarks are drawn: localize and map write theirs.")
    note = off_by_frame(result)
    return [*said, note] if note else said


def map_words(results: Sequence[PagedResult]) -> dict[str, str]:
    """The title of the section with the map, and what its lines and marks are: only those that it has."""
    has_paths = any(one.drawn is not None for one in results)
    is_drive = has_paths or any(len(one.bundles) for one in results)
    words = "; ".join(text for text in _LEGEND if any(text in _drawn(one) for one in results))
    legend = f"{words[:1].upper()}{words[1:]}." if words else ""
    if len(results) > 1:
        legend += " Of the baseline marks are open" + (" and the line is dotted." if has_paths else ".")
    return {"map_title": "The drive" if is_drive else "The map", "map_legend": legend.strip()}


def _drawn(result: PagedResult) -> list[str]:
    """Which of the legend's lines and marks a result has."""
    drawing, drawn = result.drawing, result.drawn
    has_regions = drawing.landmarks is not None and bool(drawing.landmarks.covariances.any())
    has_truth = drawn is not None and drawn.truth is not None
    has = has_truth, drawn is not None, result.odometry is not None, has_regions or drawn is not None
    return [text for text, is_there in zip(_LEGEND, (*has, drawing.objects is not None), strict=True) if is_there]


def off_by_frame(result: PagedResult) -> str | None:
    """What to say where most poses lie in another frame than the truth."""
    figures = result.evaluation
    note = frame_note(figures["position"], aligned=figures["alignment"] is not None)
    return f"{result.name}: {note}." if note else None


def share(part: int, whole: int) -> str:
    """A share in percent; only what is whole is 100 %."""
    if not whole:
        return "–"
    percent = 100 * part / whole
    return f"{percent:.0f} %" if part in {0, whole} else f"{min(max(percent, 0.1), 99.9):.1f} %"


def metres(value: float | None) -> str:
    """A length as it reads best."""
    if value is None:
        return "–"
    if abs(value) < 0.1:
        return f"{1000 * value:.1f} mm"
    return f"{value:.2f} m"


def duration(seconds: float) -> str:
    """A time span as it reads best."""
    whole = round(seconds)
    if whole < 120:
        return f"{seconds:.1f} s"
    hours, minutes = divmod(whole // 60, 60)
    return f"{hours} h {minutes} min" if hours else f"{minutes} min {whole % 60} s"
