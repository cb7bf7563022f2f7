"""Drive a robot through a simulated world and record what its sensors see."""

import os
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from mcap_landmarks.cli import options, scenarios
from mcap_landmarks.cli.console import progress, say, say_json, table, warn
from mcap_landmarks.errors import UsageError
from mcap_landmarks.locations import Location, location
from mcap_landmarks.runs.outputs import check_recording
from mcap_landmarks.wording import counted

if TYPE_CHECKING:
    from mcap_landmarks_generator.checks import Staged
    from mcap_landmarks_generator.record import Summary


def command(
    scenario: Annotated[
        str | None, typer.Argument(metavar="SCENARIO", help="Name of a bundled scenario, or a TOML file.")
    ] = None,
    output: Annotated[
        Location | None, typer.Option("-o", "--output", parser=location, help="Recording to write (MCAP).")
    ] = None,
    world: scenarios.World = None,
    seed: scenarios.Seed = None,
    settings: scenarios.Values = None,
    workers: scenarios.Workers = None,
    overwrite: options.Overwrite = False,
    list_scenarios: Annotated[bool, typer.Option("--list", help="List the bundled scenarios and exit.")] = False,
    json: options.Json = False,
) -> None:
    """Drive a robot through the world of SCENARIO and record camera, LiDAR, odometry and the truth in a new MCAP file.

    Collisions are reported in the summary; the recording is complete all the same.
    """
    if list_scenarios:
        _list(json)
        return
    if scenario is None or output is None:
        raise UsageError(
            "name a scenario and where to write: mcap-landmarks generate SCENARIO -o LOG.mcap (see --list)"
        )
    from mcap_landmarks.runs.replacing import check_apart, generated_recording, output_to

    target = check_recording(output)
    check_apart([target], [file for file in [Path(scenario), world] if file is not None and not _is_missing(file)])
    staged = scenarios.staged_scenario(scenario, world, settings or [], seed)
    from mcap_landmarks_generator.record import manifest, record
    from mcap_landmarks_generator.trajectory import expected_duration_s

    way, factor = staged.scenario.trajectory, staged.scenario.robot.speed_factor
    seconds = round(expected_duration_s(way, staged.start, factor))
    earlier = generated_recording(manifest(staged).entries())
    with (
        output_to(target, (), earlier, overwrite=overwrite),
        progress(f"generate {staged.name}", seconds, "simulated s") as advance,
    ):
        summary = record(staged, target, workers or os.cpu_count() or 1, advance)
    for time_s, name in summary.collisions:
        warn(f"warning: {time_s:.1f} s after the start the robot ran into {name}")
    if json:
        say_json("generate", _document(staged, target, summary))
    else:
        _print(target, summary)


def _is_missing(place: Location) -> bool:
    return isinstance(place, Path) and not place.is_file()


def _list(json: bool) -> None:
    from mcap_landmarks_generator.bundled import bundled

    found = bundled()
    if json:
        say_json("generate", {"scenarios": [{"name": name, "description": text} for name, text in found.items()]})
        return
    for name, text in found.items():
        say(f"{name:24}{text}")


def _document(staged: "Staged", output: Location, summary: "Summary") -> dict[str, object]:
    return {
        "output": str(output),
        "scenario": staged.name,
        "seed": staged.scenario.seed,
        "simulated_s": summary.simulated_s,
        "topics": summary.messages,
        "collisions": [{"time_s": time_s, "object": name} for time_s, name in summary.collisions],
    }


def _print(output: Location, summary: "Summary") -> None:
    table(["topic", "messages"], [[topic, str(count)] for topic, count in sorted(summary.messages.items())])
    collisions = f", {counted(len(summary.collisions), 'collision')}" if summary.collisions else ""
    say(f"{output}: {summary.simulated_s:.1f} s simulated{collisions}")
