"""Options that several verbs take, so that they read alike everywhere."""

from typing import Annotated

import typer

from mcap_landmarks.locations import Location, location, to_read

Json = Annotated[bool, typer.Option("--json", help="Print one JSON document instead of text.")]
Output = Annotated[
    Location,
    typer.Option("-o", "--output", parser=location, help="Where to write: a file, or a folder for several outputs."),
]
MaybeOutput = Annotated[
    Location | None,
    typer.Option("-o", "--output", parser=location, help="Where to write: a file, or a folder for several outputs."),
]
MapFile = Annotated[Location, typer.Option("--map", parser=location, help="Landmark database (SQLite file).")]
MaybeMapFile = Annotated[
    Location | None, typer.Option("--map", parser=location, help="Landmark database (SQLite file).")
]
ResultsOnly = Annotated[bool, typer.Option("--results-only", help="Write the new channels without the input's.")]
Start = Annotated[
    str | None,
    typer.Option("--start", help="First log time: RFC 3339 or integer nanoseconds. What holds then comes along."),
]
End = Annotated[str | None, typer.Option("--end", help="Log time to stop before: RFC 3339 or integer nanoseconds.")]
Remap = Annotated[list[str] | None, typer.Option("--remap", metavar="FROM=TO", help="Read topic FROM as TO.")]
TimeOffset = Annotated[
    list[str] | None,
    typer.Option(
        "--time-offset",
        metavar="ROLE=SECONDS",
        help="Seconds to add to the stamps of a role's messages: odometry, scan, second_scan, image or scene_objects; "
        "repeatable.",
    ),
]
Distro = Annotated[
    str | None,
    typer.Option("--distro", help="ROS 2 distribution of bags without definitions, such as humble."),
]
Definitions = Annotated[
    list[Location] | None,
    typer.Option(
        "--definitions",
        parser=location,
        metavar="DIR|FILE",
        help=".msg, .srv, .action and .idl of types that bags do not define, as in a package's share/; repeatable.",
    ),
]
OdometryTopic = Annotated[
    str | None, typer.Option("--odom", help="Odometry topic, where the log has several; none to go on without.")
]
ImageTopics = Annotated[
    list[str] | None,
    typer.Option(
        "--image",
        metavar="TOPIC|all",
        help="Image topic, where the log has several; several times for several cameras, all for every camera that has "
        "a CameraInfo of its own.",
    ),
]
ScanTopics = Annotated[
    list[str] | None, typer.Option("--scan", help="Scan topic, where the log has several; twice for two LiDARs.")
]
ScanFrom = Annotated[
    str | None,
    typer.Option(
        "--scan-from",
        metavar="TOPIC",
        help="Point cloud to read as the scan, whole or a slice of it; de-skewed if its points tell their times.",
    ),
]
Slice = Annotated[
    str | None,
    typer.Option(
        "--slice",
        metavar="ZMIN:ZMAX",
        help="Take a slice of the cloud alone, between heights above the base frame in metres.",
    ),
]
ImageRate = Annotated[
    float | None, typer.Option("--image-rate", metavar="HZ", help="Leave out images that come faster than this.")
]
Segments = Annotated[
    float | None,
    typer.Option(
        "--segments",
        metavar="SECONDS",
        help="Cut each log into parts of so much log time and detect in them with --workers; same results.",
    ),
]
SegmentWorkers = Annotated[
    int | None, typer.Option("--workers", min=1, help="Processes for --segments; as many as cores by default.")
]
Every = Annotated[
    str | None,
    typer.Option("--every", metavar="0.2m,5deg", help="Leave out images until the robot moved or turned so far."),
]
Model = Annotated[
    Location | None,
    typer.Option(
        "--model",
        metavar="FILE|NAME",
        parser=location,
        help="Detector: an export (ONNX), `bundled`, or one of `models list`. Default: the bundled one for logs of the "
        "generator, else the one that `models get` fetched.",
    ),
]
Names = Annotated[
    Location | None,
    typer.Option("--names", parser=location, help="Class names, one per line, where the model has none."),
]
Extrinsics = Annotated[
    Location | None,
    typer.Option("--extrinsics", parser=location, help="Where the sensors are on the robot, if the log does not say."),
]
Use = Annotated[
    list[str] | None,
    typer.Option("--use", metavar="STAGE", help="Stage to use where several can make what the log lacks; repeatable."),
]
Fixed = Annotated[
    bool,
    typer.Option("--fixed", help="Leave out what may stand elsewhere another day, by its class: people, cars, bags."),
]
Overwrite = Annotated[
    bool,
    typer.Option(
        "--overwrite", help="Replace files that are no earlier result of the same verb and inputs; never an input."
    ),
]
Force = Annotated[bool, typer.Option("--force", help="Run every stage anew, also where its results are there.")]
Lenient = Annotated[
    bool,
    typer.Option(
        "--lenient",
        help="Take no index of an MCAP log at its word: read it from the front, record by record, as recover does. "
        "Without this its index is used where the records prove it right, and the log is read from the front where "
        "not.",
    ),
]
ConfigFile = Annotated[
    Location | None, typer.Option("--config", parser=location, help="TOML file with one table per stage.")
]
Set = Annotated[list[str] | None, typer.Option("--set", metavar="STAGE.KEY=VALUE", help="One setting; repeatable.")]
MaxMemory = Annotated[
    str | None,
    typer.Option(
        "--max-memory",
        metavar="SIZE",
        help="What one thing in a file may take, such as 4G; half the machine's if unset.",
    ),
]
Method = Annotated[str | None, typer.Option("--method", help="Sets the method of every stage: default or thesis.")]


def add_definitions(
    settings: dict[str, dict[str, object]], distro: str | None, definitions: list[Location] | None
) -> None:
    """Add to the settings where definitions come from that bags lack."""
    if distro:
        settings.setdefault("rosbag2", {})["distro"] = distro
    for source in ("rosbag1", "rosbag2") if definitions else ():
        settings.setdefault(source, {})["definitions"] = [str(to_read(place)) for place in definitions or ()]
