"""What is wrong with the logs and options of a batch, found before anything runs and not in every worker."""

from collections.abc import Collection, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from typer.core import TyperCommand, TyperOption

from mcap_landmarks.errors import UsageError
from mcap_landmarks.moments import time_ns

if TYPE_CHECKING:
    from mcap_landmarks.fleet.inputs import FleetLog

_ONE_FILE = {"evaluate": ("--tum", "--thesis")}
_OF_ONE_LOG = {"--from-reference", "--segments", "--parts", "--collect"}
"""Options that make no sense for many logs; a batch has workers for its logs already."""
_OF_BATCH = {
    "--output": "-o of batch and `name` say where results go",
    "--json": "give --json to batch, on the command line",
    "--workers": "give --workers to batch, on the command line",
}
"""Options of verbs that batch has itself; on the command line they are its own."""
_OF_MAP = {"--map": "-o of batch, or --map on the command line, says where the map goes"}
_TIMES = ("--start", "--end")


def takes_value(own: TyperCommand) -> dict[str, bool]:
    """The options of a verb by name, and whether each takes a value."""
    return {name: not option.is_flag for option in _options(own) for name in option.opts}


def check_names(verb: str, own: TyperCommand, names: Collection[str], where: str = "") -> None:
    """Refuse what is no option of a verb for many logs; `where` begins the message.

    Raises:
        UsageError: one is none.
    """
    known = takes_value(own)
    for name in names:
        if name not in known:
            raise UsageError(f"{where}{name} is no option of {verb}; see mcap-landmarks {verb} --help")
        if name in _OF_ONE_LOG:
            raise UsageError(
                f"{where}{name} is for one log, and batch {verb} has many; run {verb} without batch for it"
            )
        if name in _ONE_FILE.get(verb, ()):
            raise UsageError(
                f"{where}{name} names one file, and batch {verb} has many logs; run {verb} without batch for it"
            )


def check_logs(verb: str, own: TyperCommand, logs: "Sequence[FleetLog]") -> None:
    """Refuse options of a manifest that are none of the verb, are batch's own or have values of another kind; and
    folders of recordings, which are no log.

    Raises:
        UsageError: there is such a one.
    """
    flags = {name for name, takes in takes_value(own).items() if not takes}
    reserved = {**_OF_BATCH, **(_OF_MAP if verb == "map" else {})}
    for log in logs:
        if verb != "convert":
            _check_folder(log)
        for key, value in log.options.items():
            where, option = log.origins[key], f"--{key}"
            if option in reserved:
                raise UsageError(f"{where}: batch sets this itself; {reserved[option]}")
            check_names(verb, own, [option], f"{where}: ")
            if option in flags and not isinstance(value, bool):
                raise UsageError(f"{where} = {value!r}: {key} is a flag; give true or false")
            if option not in flags and isinstance(value, bool):
                raise UsageError(f"{where} = {str(value).lower()}: {key} takes a value; give one, or leave it out")


def check_values(
    verb: str, own: TyperCommand, words: Sequence[str], log: "FleetLog | None" = None, passed: Sequence[str] = ()
) -> None:
    """Parse the words of one log, and refuse times that are none, and files to read that are not there.

    Args:
        verb: what is done.
        own: the verb's command.
        words: what its parser gets.
        log: of which a manifest may say where it has an option.
        passed: options of the command line, which go before those of a manifest.

    Raises:
        UsageError: an option makes no sense.
    """
    context = own.make_context(f"mcap-landmarks {verb}", list(words))
    given = {word.partition("=")[0] for word in passed}
    origins = {f"--{key}": where for key, where in (log.origins if log else {}).items() if f"--{key}" not in given}
    outputs = {"--output", *(("--map",) if verb == "map" else ())}
    for option in _options(own):
        if outputs.isdisjoint(option.opts):
            found = context.params.get(option.name or "")
            for value in found if isinstance(found, (list, tuple)) else [found]:
                _check_value(option.opts[0], value, origins)


def _check_value(name: str, value: object, origins: Mapping[str, str]) -> None:
    where = origins.get(name)
    if name in _TIMES and isinstance(value, str):
        time_ns(value, f"{where} =" if where else name)
    is_network = name == "--model" and isinstance(value, Path) and value.parent == Path() and not value.suffix
    if isinstance(value, Path) and not is_network and not value.exists():
        if where:
            raise UsageError(f"{where} = '{value}': there is no such file; name it from where the command runs")
        raise UsageError(f"{name} {value}: there is no such file; check the path")


def _check_folder(log: "FleetLog") -> None:
    """Bags and data sets are logs, whatever the verb then says of them."""
    place = log.place
    if isinstance(place, Path) and place.is_dir() and not (place / "metadata.yaml").exists():
        inside = [path.name for path in place.iterdir()]
        if any(name.endswith(".mcap") for name in inside) and not any(".db3" in name for name in inside):
            raise UsageError(f"{place} is a folder of recordings; name them: '{place}/*.mcap'")


def _options(own: TyperCommand) -> list[TyperOption]:
    return [option for option in own.params if isinstance(option, TyperOption)]
