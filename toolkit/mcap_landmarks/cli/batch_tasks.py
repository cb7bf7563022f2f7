"""The tasks of a batch: which logs, which output each, and the verb's options, checked before anything runs."""

from collections.abc import Sequence
from itertools import islice
from typing import TYPE_CHECKING

import typer
from typer.core import TyperCommand, TyperGroup

from mcap_landmarks.cli.batch_checks import check_logs, check_names, check_values, takes_value
from mcap_landmarks.errors import UsageError
from mcap_landmarks.locations import Location, Url, address

if TYPE_CHECKING:
    from mcap_landmarks.fleet.tasks import Task

VERBS = {
    **dict.fromkeys(("convert", "detect", "cluster", "fuse", "localize", "run"), ".mcap"),
    "map": ".db",
    "evaluate": ".json",
}
"""What a batch can do, and the suffix of its results."""
_DETECTS = ("detect", "localize", "run")
ONE_THREAD = ("--set", "detect.threads=1")
"""What workers are told that are as many as cores."""


def tasks_of(verb: str, words: Sequence[str], output: Location) -> "list[Task]":
    """What to run; the options are checked by the verb's own parser.

    Raises:
        UsageError: the verb, an option, a manifest or an output makes no sense.
    """
    from mcap_landmarks.fleet.fleet_manifest import words_of
    from mcap_landmarks.fleet.inputs import find_logs, outputs_in
    from mcap_landmarks.fleet.tasks import Task
    from mcap_landmarks.runs.outputs import make_folder

    own, names, passed = split(verb, words)
    threads = ONE_THREAD if verb in _DETECTS else ()
    tasks: list[Task] = []
    checked: set[tuple[str, ...]] = set()
    logs = find_logs(names)
    check_logs(verb, own, logs)
    for log, target in outputs_in(make_folder(output), logs, VERBS[verb]):
        options = (*threads, *words_of(log.options), *passed)
        where = () if verb == "evaluate" else ("-o", word(target))
        tasks.append(Task(log.place, target, (verb, word(log.place), *where, "--json", *options)))
        if options not in checked:
            checked.add(options)
            check_values(verb, own, tasks[-1].words[1:], log, passed)
    if verb == "evaluate":
        _check_documents(tasks, [log.place for log in logs])
    return tasks


def word(place: Location) -> str:
    """A location as a command line has it; what is shown of a URL may lack its credentials."""
    return place.text if isinstance(place, Url) else str(place)


def _check_documents(tasks: "Sequence[Task]", logs: Sequence[Location]) -> None:
    """Refuse to replace what is there by the documents that are kept here, before anything runs: one after the other,
    as a process may hold few files open.
    """
    from mcap_landmarks.runs.replacing import new_files

    read = {address(log): log for log in logs}
    for task in tasks:
        also = read.get(address(task.output), task.log)
        with new_files([task.output], [also], overwrite="--overwrite" in task.words):
            pass


def _command_of(verb: str) -> TyperCommand:
    from mcap_landmarks.cli.main import build

    if verb in VERBS:
        application = typer.main.get_command(build(verb))
        own = application.commands.get(verb) if isinstance(application, TyperGroup) else None
        if isinstance(own, TyperCommand):
            return own
    raise UsageError(f"batch {verb}: there is no such verb for many logs; choose one of {', '.join(VERBS)}")


def split(verb: str, words: Sequence[str]) -> tuple[TyperCommand, list[str], list[str]]:
    """The verb's own command, the names of logs, and the verb's options with their values.

    Raises:
        UsageError: there is no such verb or option, or no log is named.
    """
    own = _command_of(verb)
    takes = takes_value(own)
    names, passed = [], []
    rest = iter(words)
    for given in rest:
        if not given.startswith("-"):
            names.append(given)
            continue
        name, equals, _ = given.partition("=")
        check_names(verb, own, [name])
        passed.append(given)
        if takes[name] and not equals:
            passed.extend(islice(rest, 1))
    if not names:
        raise UsageError(f"batch {verb}: name the logs, a quoted pattern such as 'logs/*.mcap', or a manifest")
    return own, names, passed
