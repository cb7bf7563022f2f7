"""Save what is sound of a damaged log, and tell what is lost."""

from typing import TYPE_CHECKING, Annotated

import typer

from mcap_landmarks.cli import options
from mcap_landmarks.cli.console import PARTIAL, progress, say, say_json, warn
from mcap_landmarks.locations import Location, location
from mcap_landmarks.wording import counted

if TYPE_CHECKING:
    from mcap_landmarks.runs.recover import Recovered


def command(
    log: Annotated[
        Location, typer.Argument(metavar="IN", parser=location, help="MCAP, ROS 1 .bag, .db3 or ROS 2 folder.")
    ],
    output: options.Output,
    distro: options.Distro = None,
    definitions: options.Definitions = None,
    overwrite: options.Overwrite = False,
    json: options.Json = False,
) -> None:
    """Save everything of IN that is sound into a new MCAP file, and tell what is lost.

    An MCAP file is read from the front, record by record, whatever its index says: behind what is damaged reading goes
    on at the next sound record, a chunk that its CRC does not prove is left out, and everything else arrives as it was.
    Bags become MCAP as convert makes it, as far as they can be read. Exit code 3 if anything is lost, 1 if everything.
    """
    from mcap_landmarks.runs.recover import recover, report

    settings: dict[str, dict[str, object]] = {}
    options.add_definitions(settings, distro, definitions)
    done = recover(log, output, progress, settings, overwrite=overwrite)
    for note in done.notes:
        warn(f"note: {log}: {note}")
    for loss in done.losses:
        warn(f"warning: {log}: {loss}")
    if json:
        say_json("recover", {"output": str(done.path), **report(done), "topics": dict(sorted(done.topics.items()))})
    else:
        _print(done)
    if done.losses:
        raise typer.Exit(PARTIAL)


def _print(done: "Recovered") -> None:
    damage = done.damage
    of = "" if damage.expected is None else f" of {damage.expected}"
    say(f"{done.path}: {damage.recovered}{of} messages recovered, {counted(len(done.topics), 'topic')}")
    for chunk in damage.suspect_chunks:
        held = "an unknown number of messages" if chunk.messages is None else counted(chunk.messages, "message")
        say(f"suspect chunk at byte {chunk.offset}: {held}, {chunk.reason}")
    for stretch in damage.resyncs:
        say(f"passed over: byte {stretch.start} to byte {stretch.end}, {stretch.reason}")
    if done.lost:
        from mcap_landmarks.runs.loss_report import told_causes

        say(f"messages lost: {told_causes(done.lost)}")
    if not done.losses:
        say("nothing is lost")
