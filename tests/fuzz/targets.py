"""What is fuzzed: each target takes bytes and a folder for files, and may raise nothing but ToolkitError."""

import contextlib
import importlib
import itertools
import pkgutil
import shutil
from collections.abc import Callable
from functools import cache
from pathlib import Path

from mcap_landmarks import config, messages
from mcap_landmarks.cli.console import progress
from mcap_landmarks.errors import ToolkitError
from mcap_landmarks.inspection.info import describe
from mcap_landmarks.maps.database import read_map, read_neighbours, write_map
from mcap_landmarks.maps.exchange import Format, import_map
from mcap_landmarks.messages.codec import Message, decode
from mcap_landmarks.messages.layout import Layout, layout_of
from mcap_landmarks.messages.typestore import definition
from mcap_landmarks.mounting import read_extrinsics
from mcap_landmarks.recording.reader import open_recording
from mcap_landmarks.runs.convert import convert
from mcap_landmarks.runs.recover import recover
from mcap_landmarks.runs.topic_selection import Selection
from mcap_landmarks.sources._definition_files import DefinitionFiles
from mcap_landmarks.sources._definitions import Definitions
from mcap_landmarks.sources._foxglove import carry_foxglove
from mcap_landmarks.sources._foxglove_types import COUNTERPARTS, counterpart
from mcap_landmarks.sources._ros1_types import converted
from mcap_landmarks.stage import Connection

PARTS = b"\0\xff\0\xff"
"""Stands between the parts of an input that has several."""
FOXGLOVE = sorted(COUNTERPARTS)
ENCODINGS = ("protobuf", "json", "cdr")
FORMS = tuple(Format)
KINDS = ("msg", "ros1", "idl", "srv", "action")


def _quietly(work: Callable[[], object]) -> None:
    with contextlib.suppress(ToolkitError):
        work()


def _log(path: Path) -> None:
    """Everything that a log goes through before a stage sees it."""
    output = path.parent / "out.mcap"
    _quietly(lambda: describe(path, {}, progress))
    _quietly(lambda: convert([path], output, Selection(), {}, progress, overwrite=True))
    _quietly(lambda: recover(path, output, progress, overwrite=True))
    output.unlink(missing_ok=True)


def mcap(data: bytes, folder: Path) -> None:
    """An MCAP file: also by its index, in the order of time, and its attachments."""
    path = folder / "log.mcap"
    path.write_bytes(data)

    def read() -> None:
        with open_recording(path) as recording:
            _quietly(lambda: list(recording.attachments()))
            for _ in itertools.islice(recording.messages(), 10_000):
                pass

    _quietly(lambda: describe(path, {}))
    _quietly(read)
    _log(path)


def bag(data: bytes, folder: Path) -> None:
    """A bag of ROS 1."""
    path = folder / "log.bag"
    path.write_bytes(data)
    _log(path)


def db3(data: bytes, folder: Path) -> None:
    """A db3 by itself."""
    path = folder / "log.db3"
    path.write_bytes(data)
    _log(path)


def rosbag2(data: bytes, folder: Path) -> None:
    """A bag of ROS 2: its metadata.yaml, and its db3."""
    about, _, content = data.partition(PARTS)
    path = folder / "bag"
    path.mkdir(exist_ok=True)
    (path / "metadata.yaml").write_bytes(about)
    (path / "bag_0.db3").write_bytes(content)
    _log(path)
    shutil.rmtree(path)


@cache
def message_types() -> list[type[Message]]:
    """Every message dataclass of the toolkit."""
    modules = [
        importlib.import_module(f"{messages.__name__}.{one.name}") for one in pkgutil.iter_modules(messages.__path__)
    ]
    found = {
        value
        for module in modules
        for value in vars(module).values()
        if isinstance(getattr(value, "ROS_TYPE", None), str)
    }
    return sorted(found, key=lambda one: one.__qualname__)


def cdr(data: bytes, _folder: Path) -> None:
    """A message: of which of the toolkit's types, and its bytes."""
    known = message_types()
    chosen = known[(data[0] if data else 0) % len(known)]
    _quietly(lambda: decode(chosen, data[1:]))
    text = definition(chosen.ROS_TYPE)
    _quietly(lambda: decode(chosen, data[1:], text))
    _quietly(lambda: layout_of(chosen.ROS_TYPE, text).table([data[1:], data[1:]]))


def definitions(data: bytes, folder: Path) -> None:
    """A definition: of which kind, its text, and a message of that type."""
    kind, (text, _, message) = KINDS[(data[0] if data else 0) % len(KINDS)], data[1:].partition(PARTS)
    if kind == "msg":
        _quietly(lambda: Layout("odd/msg/Thing", text.decode("latin-1")).table([message]))
    elif kind == "ros1":
        _quietly(lambda: converted("odd/Thing", text.decode("latin-1")).convert(message))
    path = folder / "odd" / ("msg" if kind in {"msg", "ros1"} else kind) / f"Thing.{'msg' if kind == 'ros1' else kind}"
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(text)
    suffix = {"srv": "_Request", "action": "_Goal"}.get(kind, "")

    def check() -> None:
        for one in Definitions(DefinitionFiles([str(path)]), ["humble"]).of(f"odd/msg/Thing{suffix}"):
            _quietly(lambda one=one: one.check(message))  # type: ignore[misc]

    _quietly(check)
    path.unlink()


def maps(data: bytes, folder: Path) -> None:
    """A file of landmarks: in which format, and its text."""
    form, made = FORMS[(data[0] if data else 0) % len(FORMS)], folder / "made.db"
    path = folder / f"map.{form}"
    path.write_bytes(data[1:])

    def taken() -> None:
        write_map(made, import_map(path, form))
        read_map(made)

    _quietly(taken)
    made.unlink(missing_ok=True)


def databases(data: bytes, folder: Path) -> None:
    """A map's database."""
    path = folder / "map.db"
    path.write_bytes(data)

    def read() -> None:
        found = read_map(path)
        read_neighbours(path, found)
        write_map(folder / "again.db", found)

    _quietly(read)
    (folder / "again.db").unlink(missing_ok=True)


def foxglove(data: bytes, _folder: Path) -> None:
    """A message of a type of Foxglove: in which encoding, of which type, its schema, and its bytes."""
    encoding, name = (data[0], data[1]) if len(data) > 1 else (0, 0)
    schema, _, message = data[2:].partition(PARTS)
    wire, type_name = ENCODINGS[encoding % len(ENCODINGS)], FOXGLOVE[name % len(FOXGLOVE)]
    full = f"foxglove_msgs/msg/{type_name}" if wire == "cdr" else f"foxglove.{type_name}"
    connection = Connection("/tf_static", full, schema, wire, wire)
    found = counterpart(connection)
    if found is None:
        return

    def carry() -> None:
        carried = carry_foxglove(connection, found)
        if carried.mount is not None:
            _quietly(lambda: carried.mount(message))  # type: ignore[misc]
        carried.convert(message)

    _quietly(carry)


def settings(data: bytes, folder: Path) -> None:
    """A file that the user gives: extrinsics in TOML or JSON, or settings."""
    kind = (data[0] if data else 0) % 3
    path = folder / ("given.json" if kind == 1 else "given.toml")
    path.write_bytes(data[1:])
    _quietly((lambda: config.gather(path, [], None)) if kind == 2 else (lambda: read_extrinsics(path)))


def load() -> None:
    """Import what targets import late: among other work that takes longer than an input may."""
    for name in config.usable_names():
        config.declaration(name)


TARGETS: dict[str, Callable[[bytes, Path], None]] = {
    one.__name__: one for one in (mcap, bag, db3, rosbag2, cdr, definitions, maps, databases, foxglove, settings)
}
