"""What verbs share that simulate a scenario: their options, and the scenario ready to run."""

import json
from collections.abc import Sequence
from typing import TYPE_CHECKING, Annotated

import typer

from mcap_landmarks.cli.console import warn
from mcap_landmarks.errors import ToolkitError
from mcap_landmarks.locations import Location, location, to_read

if TYPE_CHECKING:
    from mcap_landmarks_generator.checks import Staged

World = Annotated[
    Location | None,
    typer.Option("--world", parser=location, help="World (SDF) whose models stand in for the scenario's objects."),
]
Seed = Annotated[int | None, typer.Option("--seed", min=0, help="Seed instead of the scenario's.")]
Values = Annotated[
    list[str] | None, typer.Option("--set", metavar="KEY=VALUE", help="One value of the scenario; repeatable.")
]
Workers = Annotated[
    int | None, typer.Option("--workers", min=1, help="Processes that render; as many as cores by default.")
]


def staged_scenario(name: str, world: Location | None, values: Sequence[str], seed: int | None) -> "Staged":
    """A scenario by name or file, ready to run; what of its world is not as it is there is told.

    Raises:
        ToolkitError: the scenario or the world is wrong, or the generator is not installed.
    """
    try:
        import mcap_landmarks_generator.engine  # noqa: F401 - what may not be installed
        from mcap_landmarks_generator.checks import stage
        from mcap_landmarks_generator.loading import load_scenario
    except ModuleNotFoundError as error:
        raise ToolkitError(f"{error.name} is not installed: pip install 'mcap-landmarks[generator]'") from error
    given = [*values, *([f"world.file={json.dumps(str(to_read(world)))}"] if world is not None else [])]
    staged = stage(load_scenario(name, given, seed))
    for line in staged.warnings:
        warn(f"warning: {line}")
    return staged
