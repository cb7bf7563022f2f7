"""What is wrong with the logs and options of a batch, found before anything runs and not in every worker."""

from collections.abc import Collection, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import typer
from typer.core import TyperCommand, TyperOption

from mcap_landmarks.errors import UsageError
from mcap_landmarks.locations import Location, Url, is_there
from mcap_landmarks.moments import time_ns

if TYPE_CHECKING:
    from mcap_landmarks.config import Settings
    from mcap_landmarks.fleet.inputs import FleetLog

_ONE_FILE = {"evaluate": ("--tum", "--thesis")}
_OF_ONE_LOG = {"--from-reference", "--segments", "--parts", "--collect"}
"""Options that make no sense for many logs; a batch has workers for its logs already."""
_INSTEAD = {
    "--segments": "leave it out, as --workers logs are done at a time; or cut a long log with it without batch, first",
}
"""What to do without them, where that is something else than to do without a batch."""
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
            instead = _INSTEAD.get(name, f"run {verb} without batch for it")
            raise UsageError(f"{where}{name} is for one log, and batch {verb} has many; {instead}")
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
    """Parse the words of one log, and refuse settings and times that are none, and files and networks to read that are
    not there.

    Args:
        verb: what is done.
        own: the verb's command.
        words: what its parser gets.
        log: of which a manifest may say where it has an option.
        passed: options of the command line, which go before those of a manifest.

    Raises:
        UsageError: an option makes no sense.
    """
    given = {word.partition("=")[0] for word in passed}
    origins = {f"--{key}": where for key, where in (log.origins if log else {}).items() if f"--{key}" not in given}
    found = _parsed(verb, own, words, origins)
    outputs = {"--output", *(("--map",) if verb == "map" else ())}
    for name, values in found.items():
        if name not in outputs:
            for value in values:
                _check_value(name, value, origins.get(name))
    _check_settings(found, origins)


def _parsed(
    verb: str, own: TyperCommand, words: Sequence[str], origins: Mapping[str, str]
) -> dict[str, Sequence[object]]:
    """The values of each option by its long name, as the verb's parser understands them."""
    try:
        context = own.make_context(f"mcap-landmarks {verb}", list(words))
    except typer.BadParameter as error:
        names = error.param.opts if error.param else ()
        for name in names:
            if name in origins:
                raise UsageError(f"{origins[name]}: no value of {name}; see mcap-landmarks {verb} --help") from error
        raise
    values = {max(option.opts, key=len): context.params.get(option.name or "") for option in _options(own)}
    return {name: [*value] if isinstance(value, (list, tuple)) else [value] for name, value in values.items()}


def _check_value(name: str, value: object, where: str | None) -> None:
    if name in _TIMES and isinstance(value, str):
        time_ns(value, f"{where} =" if where else name)
    if not isinstance(value, (Path, Url)):
        return
    if name == "--model" and _is_network(value):
        _check_network(value, where)
    elif not is_there(value):
        if where:
            raise UsageError(f"{where} = '{value}': there is no such file; name it from where the command runs")
        raise UsageError(f"{name} {value}: there is no such file; check the path")


def _check_settings(found: Mapping[str, Sequence[object]], origins: Mapping[str, str]) -> None:
    """Refuse settings that are none, and those that name a file or network that is not there."""
    from mcap_landmarks.config import named_files

    (file,), texts = found.get("--config", [None]), [str(text) for text in found.get("--set", ()) if text is not None]
    config = file if isinstance(file, (Path, Url)) else None
    from_manifest = origins.get("--set" if texts else "--config", "")
    for key, place in named_files(_gathered(config, texts, from_manifest)).items():
        is_set = any(text.partition("=")[0].strip() == key for text in texts)
        where = f"{origins.get('--set', '--set')}: {key}" if is_set else f"{file}: {key}"
        if key == "detect.model" and _is_network(place):
            _check_network(place, where)
        elif not is_there(place):
            raise UsageError(f"{where} = '{place}': there is no such file; name it from where the command runs")


def _gathered(file: Location | None, texts: Sequence[str], where: str) -> "Settings":
    """The settings of a file and of texts; what a manifest has of them is refused by its name."""
    from mcap_landmarks.config import gather

    try:
        return gather(file, texts, None)
    except UsageError as error:
        raise UsageError(f"{where}: {error}" if where else str(error)) from error


def _is_network(place: Location) -> bool:
    """Whether a model is called by a name: one word without a dot."""
    return isinstance(place, Path) and place.parent == Path() and not place.suffix


def _check_network(name: Location, where: str | None) -> None:
    """Refuse the name of a network that is not here, with where a manifest or file has it."""
    from mcap_landmarks.networks.choice import choose_network

    try:
        choose_network(name, generated=False)
    except UsageError as error:
        raise UsageError(f"{where}: {error}" if where else str(error)) from error


def _check_folder(log: "FleetLog") -> None:
    """Bags and data sets are logs, whatever the verb then says of them."""
    place = log.place
    if isinstance(place, Path) and place.is_dir() and not (place / "metadata.yaml").exists():
        inside = [path.name for path in place.iterdir()]
        if any(name.endswith(".mcap") for name in inside) and not any(".db3" in name for name in inside):
            raise UsageError(f"{place} is a folder of recordings; name them: '{place}/*.mcap'")


def _options(own: TyperCommand) -> list[TyperOption]:
    return [option for option in own.params if isinstance(option, TyperOption)]
