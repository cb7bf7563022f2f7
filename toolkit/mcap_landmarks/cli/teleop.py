"""Drive the simulated robot by hand, from the keyboard of a terminal."""

import os
from functools import partial
from typing import TYPE_CHECKING, Annotated

import typer

from mcap_landmarks.cli import options, scenarios
from mcap_landmarks.cli.console import say, warn
from mcap_landmarks.cli.terminal import check_terminal, open_terminal
from mcap_landmarks.locations import Location, location
from mcap_landmarks.wording import counted

if TYPE_CHECKING:
    from mcap_landmarks_generator.cockpit import Look

    from mcap_landmarks.messages.detections import Detections
    from mcap_landmarks.messages.images import CompressedImage
    from mcap_landmarks.stage import Config


def command(
    scenario: Annotated[str, typer.Argument(metavar="SCENARIO", help="Name of a bundled scenario, or a TOML file.")],
    output: Annotated[Location, typer.Option("-o", "--output", parser=location, help="Recording to write (MCAP).")],
    world: scenarios.World = None,
    seed: scenarios.Seed = None,
    settings: scenarios.Values = None,
    model: Annotated[
        Location | None,
        typer.Option(
            "--model", metavar="FILE|NAME", parser=location, help="Detector whose finds are shown; `bundled` is there."
        ),
    ] = None,
    workers: scenarios.Workers = None,
    overwrite: options.Overwrite = False,
) -> None:
    """Drive the robot of SCENARIO through its world with w, x, a, d, s and q, and record what its sensors see.

    Ctrl-C and a terminal that is lost end the drive as q does: the recording is whole.
    """
    from mcap_landmarks.runs.outputs import check_recording
    from mcap_landmarks.runs.replacing import new_files

    target, look = check_recording(output), _look_with(model)
    with new_files([target], [world], overwrite=overwrite):
        check_terminal()
        staged = scenarios.staged_scenario(scenario, world, settings or [], seed)
        from mcap_landmarks_generator.cockpit import Cockpit
        from mcap_landmarks_generator.record import record

        with open_terminal() as terminal:
            cockpit = Cockpit(staged, terminal, f"{staged.name} -> {target.name}", look)
            summary = record(staged, target, workers or os.cpu_count() or 1, by_hand=cockpit)
    for time_s, name in summary.collisions:
        warn(f"warning: {time_s:.1f} s after the start the robot ran into {name}")
    messages = counted(sum(summary.messages.values()), "message")
    say(f"{target}: {summary.simulated_s:.1f} s driven, {messages}")


def _look_with(model: Location | None) -> "Look | None":
    """What a detector finds in one image; None where there is none."""
    if model is None:
        return None
    from mcap_landmarks.config import load_files
    from mcap_landmarks.stages.detect import STAGE

    config, files = load_files(STAGE, {}, {"model": model}, generated=True)
    list(STAGE.process((), config, files.paths))  # of a model that cannot be used it complains now
    return partial(_detections, config, files.paths["model"])


def _detections(config: "Config", model: Location, image: "CompressedImage") -> "Detections":
    from mcap_landmarks.channels import CAMERA_IMAGE
    from mcap_landmarks.messages.detections import Detections
    from mcap_landmarks.stage import Bundle, Stamped
    from mcap_landmarks.stages.detect import STAGE

    bundle = Bundle(image.stamp_ns, image.stamp_ns, {CAMERA_IMAGE: image})
    found = [
        result.message for result in STAGE.process([bundle], config, {"model": model}) if isinstance(result, Stamped)
    ]
    return next(message for message in found if isinstance(message, Detections))
