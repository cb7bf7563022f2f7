"""Show the configuration of all stages, or what can be written in it."""

import typer

from mcap_landmarks.cli import options
from mcap_landmarks.cli.console import say, say_json, warn

app = typer.Typer(no_args_is_help=True)


@app.command()
def show(
    config_file: options.ConfigFile = None,
    settings: options.Set = None,
    method: options.Method = None,
    json: options.Json = False,
) -> None:
    """Print the configuration that is in force, defaults included, as TOML that --config takes."""
    from mcap_landmarks.config import gather, problems
    from mcap_landmarks.runs.config_text import everything, toml

    tables = everything(gather(config_file, settings or [], method))
    for problem in problems():
        warn(f"warning: {problem}")
    if json:
        say_json("config_show", {"config": tables})
    else:
        for line in toml(tables).rstrip().split("\n"):
            say(line)


@app.command()
def schema() -> None:
    """Print the JSON schema of a configuration file, for editors."""
    import json

    from mcap_landmarks.runs.config_text import json_schema

    for line in json.dumps(json_schema(), indent=2, ensure_ascii=False).split("\n"):
        say(line)
