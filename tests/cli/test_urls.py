"""A URL in any place where a verb takes a file: one where nothing lies is named in one line, without its secrets."""

import inspect
import re
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import get_args

import pytest
from mcap_landmarks.cli.main import build, verbs
from mcap_landmarks.locations import Location, location
from mcap_landmarks.resources import resource

from tests.cli.calls import call, refused
from tests.cli.logs import messages, write
from tests.runs.chain import raw_log, two_posts

LINES = {
    "batch": "batch convert LOG -o {output} --events {events} --catalogue {catalogue}",
    "cluster": "cluster {logs} -o {output} --extrinsics {extrinsics} --config {config_file}",
    "config show": "config show --config {config_file}",
    "convert": "convert {inputs} -o {output} --config {config_file} --definitions {definitions}",
    "demo": "demo -o {output}",
    "detect": "detect {logs} -o {output} --model {model} --names {names} --config {config_file}",
    "diff": "diff {baseline} {candidate} --reference {reference} --criteria {criteria} --baseline {blessed} "
    "--junit {junit} --markdown {markdown}",
    "evaluate": "evaluate {result} --reference {reference} --tum {tum} --thesis {thesis}",
    "explain": "explain {result} --at 1 -o {output}",
    "export": "export {result} --format coco -o {output} --images {images}",
    "foxglove": "foxglove {result} -o {output}",
    "fuse": "fuse {logs} -o {output} --extrinsics {extrinsics} --config {config_file}",
    "generate": "generate small -o {output} --world {world}",
    "teleop": "teleop small -o {output} --model {model} --world {world}",
    "info": "info {paths} --definitions {definitions}",
    "landmarks export": "landmarks export {database} {file}",
    "landmarks import": "landmarks import {database} {file}",
    "landmarks show": "landmarks show {database}",
    "localize": "localize {logs} -o {output} --map {map_file} --model {model} --extrinsics {extrinsics} "
    "--config {config_file}",
    "map": "map {logs} -o {output} --map {map_file} --prior {prior} --model {model} --extrinsics {extrinsics} "
    "--config {config_file}",
    "models audition": "models audition {model} -o {output} --classes suitcase --names {names}",
    "models check": "models check {model} -o {output} --image {images} --names {names}",
    "models get": "models get nanodet --from {archive}",
    "plot": "plot {inputs} -o {output}",
    "recover": "recover {log} -o {output} --definitions {definitions}",
    "report": "report {results} -o {output} --reference {reference} --run {printed}",
    "video": "video {result} -o {output}",
    "run": "run {logs} -o {output} --stages detect,cluster,fuse,localize --map {map_file} --model {model} "
    "--names {names} --extrinsics {extrinsics} --config {config_file}",
}
"""Every verb with every place where it takes a file, by the name of its parameter."""
ENDINGS = {
    **dict.fromkeys(("explain", "plot", "models check", "models audition"), "png"),
    "video": "mp4",
    **dict.fromkeys(("landmarks import", "landmarks export"), "json"),
    "report": "html",
}
EACH = [(verb, name) for verb, line in LINES.items() for name in re.findall(r"{(\w+)}", line)]


def parameters() -> Iterator[tuple[str, inspect.Parameter]]:
    """Every parameter of every verb."""
    for verb in verbs():
        app = build(verb)
        single = [info for info in app.registered_commands if info.name == verb]
        nested = [info for group in app.registered_groups for info in group.typer_instance.registered_commands]
        for info in single or nested:
            name = verb if single else f"{verb} {info.name or info.callback.__name__}"
            yield from ((name, parameter) for parameter in inspect.signature(info.callback).parameters.values())


@pytest.fixture(scope="module")
def files(tmp_path_factory: pytest.TempPathFactory) -> Mapping[str, Path]:
    """A file for every place, by the name of its parameter, that the verbs take without complaint."""
    folder = tmp_path_factory.mktemp("files")
    log, scenes = raw_log(folder / "log.mcap"), write(folder / "scenes.mcap", messages())
    database = folder / "map.db"
    assert call("map", scenes, "--map", database) == 0
    (folder / "names.txt").write_text("person\nfire hydrant\n")
    (folder / "extrinsics.json").write_text('{"transforms": []}')
    (folder / "config.toml").touch()
    (folder / "run.json").write_text('{"seconds": {}}')
    (folder / "State.msg").write_text("int32 value\n")
    return {
        **dict.fromkeys(("log", "logs", "inputs", "paths", "baseline", "reference", "result", "results"), log),
        **dict.fromkeys(("map_file", "database", "prior"), database),
        "candidate": scenes,
        "model": two_posts(folder / "model.onnx"),
        "world": Path(__file__).parents[1] / "generator" / "worlds" / "depot.sdf",
        "names": folder / "names.txt",
        "printed": folder / "run.json",
        "images": resource("recordings", "demo.png"),
        "config_file": folder / "config.toml",
        "extrinsics": folder / "extrinsics.json",
        "file": folder / "map.json",
        "output": folder / "new",
        "definitions": folder / "State.msg",
        "events": folder / "new.jsonl",
        "catalogue": folder / "new.db",
        "tum": folder / "new.tum",
        "thesis": folder / "new.txt",
        "criteria": folder / "config.toml",
        "blessed": folder,
        "junit": folder / "new.xml",
        "markdown": folder / "new.md",
    }


def test_every_file_of_every_verb_is_a_location() -> None:
    takes = {(verb, p.name) for verb, p in parameters() if Location in _types(p)}
    # The output of convert is read as text first: a slash at its end says that a folder is meant.
    assert takes == set(EACH) - {("convert", "output")}
    assert not [(verb, p.name) for verb, p in parameters() if Path in _types(p)]
    assert all(get_args(p.annotation)[1].parser is location for verb, p in parameters() if (verb, p.name) in takes)


def _types(parameter: inspect.Parameter) -> tuple[object, ...]:
    return _parts(get_args(parameter.annotation)[0])


def _parts(written: object) -> tuple[object, ...]:
    """A type and all that it is made of."""
    return (written, *(part for inner in get_args(written) for part in _parts(inner)))


OUTPUTS = {
    "output",
    "catalogue",
    "file",
    "tum",
    "thesis",
    "junit",
    "markdown",
    "map_file",
    "database",
    "blessed",
    "images",
}
"""Places where some verb writes."""


@pytest.mark.slow
@pytest.mark.parametrize(("verb", "name"), EACH)
def test_a_url_where_nothing_lies_is_named_without_what_may_be_secret(
    verb: str, name: str, files: Mapping[str, Path], capsys: pytest.CaptureFixture[str]
) -> None:
    ending = "db" if name == "catalogue" else ENDINGS.get(verb, "mcap")
    url = f"memory://nowhere/a//x.{ending}?signature=secret"
    given = {**files, "output": files["output"].with_suffix(f".{ending}"), name: url}
    words = LINES[verb].format_map(given).replace("LOG", str(files["logs"])).split()
    forced = ["--overwrite"] if verb.startswith("landmarks ") and "show" not in verb else []
    capsys.readouterr()
    code = call(*words, *forced)
    (line,) = capsys.readouterr().err.strip().splitlines()
    place, _, problem = line.removeprefix("error: ").partition("?...: ")
    assert place == f"memory://nowhere/a//x.{ending}"
    if name in OUTPUTS and problem.startswith("an output"):
        assert (code, problem) == (2, "an output has no query; credentials come from the environment")
    elif name == "events":
        assert (code, problem) == (2, "events are added line by line; name a file of this machine")
    else:
        assert (code, problem) in {(kind, "there is no such file; check the URL") for kind in (1, 2)}


def test_other_schemes_settings_and_patterns(
    files: Mapping[str, Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    log, out = files["logs"], tmp_path / "out"
    for code, url, words in (
        (2, "ftp://host/map.db", ("localize", log, "-o", out, "--map", "ftp://host/map.db")),
        (1, "memory://bucket/m.onnx", ("detect", log, "-o", out, "--set", "detect.model=memory://bucket/m.onnx")),
    ):
        assert f"error: {url}: " in refused(capsys, code, *words)
