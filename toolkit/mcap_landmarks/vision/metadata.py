"""What the metadata of an ONNX file say: literals, class names and thresholds."""

import ast
from collections.abc import Mapping, Sequence

from mcap_landmarks.errors import ModelError
from mcap_landmarks.locations import Location, to_read
from mcap_landmarks.vision.onnx_session import OnnxSession, written


def literal(path: Location, metadata: Mapping[str, str], key: str) -> object:
    """The value of one entry, written as in Python; None where there is no such entry.

    Raises:
        ModelError: the entry is no literal.
    """
    text = metadata.get(key)
    if text is None:
        return None
    try:
        return ast.literal_eval(text)
    except (ValueError, SyntaxError, TypeError, MemoryError, RecursionError) as error:
        raise ModelError(f"{path}: {key} in the metadata is {text[:60]!r}; export the model again") from error


def stated_family(metadata: Mapping[str, str]) -> str | None:
    """The family that metadata name: our own entry `family`, or what Ultralytics' exporter says of the model's head.

    Its entries: `description`, of models that end in NMS `end2end` or an `nms` among `args`, and lately `head`. Those
    of YOLOv5's own exporter are the names and the stride alone, and name no family.
    """
    if "family" in metadata or "description" not in metadata:
        return metadata.get("family")
    description = metadata["description"].lower()
    if metadata.get("head") == "RTDETRDecoder" or "detr" in description:
        return "detr"
    # YOLOv10's first exporter wrote no `end2end`.
    ends = metadata.get("end2end", str("yolov10" in description)) == "True"
    return "nms_in_graph" if ends or "'nms': True" in metadata.get("args", "") else "yolov8"


def names_of(session: OnnxSession, names_file: Location | None) -> tuple[str, ...]:
    """The class names by class id: lines of a file, else the metadata's `names`.

    Raises:
        ModelError: there are none.
    """
    names = _own_names(session) if names_file is None else _names_in(names_file)
    if not names:
        outputs = ", ".join(f"{entry.name} {written(entry.shape)}" for entry in session.outputs)
        raise ModelError(
            f"{session.path}: it has no class names in its metadata; give --names FILE, one name per line, if it is a "
            f"detector (its outputs: {outputs})"
        )
    return names


def _names_in(file: Location) -> tuple[str, ...]:
    try:
        lines = to_read(file).read_text().split("\n")
    except (OSError, UnicodeDecodeError) as error:
        raise ModelError(f"{file}: not a text file of class names, one per line: {error}") from error
    return tuple(line.strip() for line in lines if line.strip())


def _own_names(session: OnnxSession) -> tuple[str, ...]:
    found = literal(session.path, session.metadata, "names")
    if found is None:
        return ()
    if isinstance(found, Mapping):
        found = [found.get(i) for i in range(len(found))]
    names = tuple(name for name in found if isinstance(name, str)) if isinstance(found, Sequence) else ()
    if not isinstance(found, Sequence) or len(names) != len(found):
        raise ModelError(f"{session.path}: the names in its metadata cannot be read; give --names FILE")
    return names


def confidence_of(session: OnnxSession, names: tuple[str, ...]) -> dict[str, float]:
    """The metadata's `confidence`, one number or a number by class name, as thresholds by class name; empty if none.

    Raises:
        ModelError: it is neither 0 to 1 nor such numbers by class name.
    """
    own = literal(session.path, session.metadata, "confidence")
    by_class = own if isinstance(own, Mapping) else {} if own is None else dict.fromkeys(names, own)
    fitting = {
        name: float(value)
        for name, value in by_class.items()
        if name in names and isinstance(value, int | float) and 0 <= value <= 1
    }
    if len(fitting) < len(by_class):
        raise ModelError(
            f"{session.path}: confidence in its metadata is neither 0 to 1 nor such numbers by its own class names "
            f"({', '.join(names)}); rename its keys too, or take it out of the metadata and set detect.confidence"
        )
    return fitting
