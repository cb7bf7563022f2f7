"""The command `mcap-landmarks`: finds the verbs in this folder and loads the one that is asked for."""

import importlib
import os
import sys
from pathlib import Path
from typing import Annotated

import typer

from mcap_landmarks import memory
from mcap_landmarks.cli.console import heeding_signals, progress, run_command, warn
from mcap_landmarks.cli.given_values import pass_on
from mcap_landmarks.cli.option_groups import spread
from mcap_landmarks.errors import UsageError
from mcap_landmarks.remote.shown_copies import copies_shown

_NOT_VERBS = {
    "__init__",
    "main",
    "console",
    "given_values",
    "option_groups",
    "options",
    "scenarios",
    "stage_runs",
    "batch_catalogue",
    "batch_checks",
    "batch_events",
    "batch_map",
    "batch_options",
    "batch_reports",
    "batch_run",
    "batch_table",
    "batch_tasks",
    "terminal",
    "conversion_options",
    "diff_drives",
    "diff_options",
    "diff_text",
    "diff_sets",
}
_READ_NO_LOGS = {"batch", "config", "demo", "generate", "models", "teleop"}
"""Verbs that take no bound on what files may claim; `batch` passes it on."""
_COMPLETION = "_MCAP_LANDMARKS_COMPLETE"
"""Set by the shell's script while it asks for completions; the words so far are in one of the variables below."""
_HELP = "Landmark maps and positions from robot recordings, offline and without ROS."


def verbs() -> dict[str, str]:
    """Every verb and the first line of its file, which is its short help; nothing is imported."""
    found = {}
    for path in sorted(Path(__file__).parent.glob("*.py")):
        if path.stem not in _NOT_VERBS:
            with path.open() as lines:
                found[path.stem] = lines.readline().strip().strip('"')
    return found


def build(asked: str | None, *, has_help: bool = True) -> typer.Typer:
    """The application, with the verb `asked` for loaded and the others known by name and short help only.

    Of the command's own help typer finds out what its value means before that of a verb is shown, with an import of a
    tenth of a second; unless it `has_help` only verbs do.
    """
    app = typer.Typer(
        name="mcap-landmarks",
        help=_HELP,
        no_args_is_help=True,
        add_completion=asked not in verbs() or _COMPLETION in os.environ,
        pretty_exceptions_enable=False,
        add_help_option=has_help,
        context_settings={"help_option_names": ["-h", "--help"]},
    )
    app.callback()(_root)
    for verb, short_help in verbs().items():
        if verb != asked:
            app.command(verb, help=short_help)(_stand_in)
            continue
        module = importlib.import_module(f"mcap_landmarks.cli.{verb}")
        reads = verb not in _READ_NO_LOGS
        if hasattr(module, "app"):
            for own in module.app.registered_commands:
                if not hasattr(own.callback, "__wrapped__"):  # not yet, by an earlier call of this
                    own.callback = spread(own.callback, reads=reads)
            app.add_typer(module.app, name=verb, help=short_help)
        else:
            settings, command = getattr(module, "context_settings", None), spread(module.command, reads=reads)
            app.command(verb, help=command.__doc__ or short_help, context_settings=settings)(command)
    return app


def _stand_in() -> None:
    raise UsageError("name the verb first: mcap-landmarks VERB [OPTIONS]")


def _show_version(wanted: bool) -> None:
    if wanted:
        from mcap_landmarks import __version__

        typer.echo(f"mcap-landmarks {__version__}")
        raise typer.Exit


def _root(
    version: Annotated[
        bool, typer.Option("--version", callback=_show_version, is_eager=True, help="Print the version and exit.")
    ] = False,
) -> None:
    """Take the options before the verb."""


def _asked(given: list[str]) -> str | None:
    """The verb of a command line; where the shell asks for completions, of the line that is being typed."""
    if _COMPLETION in os.environ:
        typed = os.environ.get("_TYPER_COMPLETE_ARGS") or os.environ.get("COMP_WORDS", "")
        given = typed.split()[1:]
    return next((word for word in given if not word.startswith("-")), None)


def run(arguments: list[str] | None = None) -> None:
    """Run the command line and exit with its code."""
    # NumPy's products are of small matrices, which BLAS shares out among threads that mostly wait in a loop for each
    # other: that took a third of the processor time of clustering. It reads this when NumPy is first imported, later.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    memory.bound_images()
    # Pydantic would look through all installed packages for plugins of its own.
    os.environ.setdefault("PYDANTIC_DISABLE_PLUGINS", "1")
    given = sys.argv[1:] if arguments is None else arguments
    asked = _asked(given)
    named = f"{asked} " if asked in verbs() else ""
    application = pass_on(typer.main.get_command(build(asked, has_help=not named or given[:1] != [asked])))
    with heeding_signals(), copies_shown(progress, warn):
        code = run_command(application, given, f"see mcap-landmarks {named}--help")
    sys.exit(code)
