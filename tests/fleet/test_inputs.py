"""Which logs are meant, by names, patterns and manifests, and where their results go."""

from pathlib import Path

import pytest
from mcap_landmarks.errors import UsageError
from mcap_landmarks.fleet.fleet_manifest import words_of
from mcap_landmarks.fleet.inputs import FleetLog, find_logs, outputs_in


def names(logs: list[FleetLog]) -> list[str]:
    return [log.place.name for log in logs]


def test_patterns_and_names_give_each_log_once(tmp_path: Path) -> None:
    for name in ("b.mcap", "a.mcap", "deep/c.mcap", "x[1].mcap"):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).touch()
    (tmp_path / "link.mcap").symlink_to(tmp_path / "a.mcap")
    found = find_logs([str(tmp_path / "x[1].mcap"), str(tmp_path / "[ab].mcap"), str(tmp_path / "**" / "*.mcap")])
    assert names(found) == ["x[1].mcap", "a.mcap", "b.mcap", "c.mcap"]
    with pytest.raises(UsageError, match=r"no\*: no file matches"):
        find_logs([str(tmp_path / "no*")])


def test_outputs_are_named_as_their_logs(tmp_path: Path) -> None:
    logs = [FleetLog(tmp_path / "a.mcap"), FleetLog(tmp_path / "bag")]
    (tmp_path / "a.mcap").touch()
    (tmp_path / "bag").mkdir()
    out = tmp_path / "out"
    out.mkdir()
    (out / "a.mcap").touch()
    earlier = FleetLog(out / "a.mcap")
    assert outputs_in(out, [*logs, earlier], ".mcap") == [(logs[0], out / "a.mcap"), (logs[1], out / "bag.mcap")]
    assert outputs_in(out, [earlier], ".json") == [(earlier, out / "a.json")]
    with pytest.raises(UsageError, match="all logs lie in the output folder"):
        outputs_in(out, [earlier], ".mcap")
    with pytest.raises(UsageError, match=r"also writes .*a\.mcap"):
        outputs_in(tmp_path, [FleetLog(tmp_path / "a.bag"), FleetLog(out / "a.bag")], ".mcap")


MANIFEST = """
[options]
map = "site.db"
odom = "/odom"
set = ["localize.max_sigma_m=0.3", "fuse.bearing_gate=4"]

[[log]]
path = "logs/monday.mcap"
start = 2026-01-31T12:00:00Z
end = 1769861000000000000

[[log]]
path = "{elsewhere}"
name = "second"
options = { odom = "/wheels", force = true, lenient = false }

[[log]]
path = "logs/monday.mcap"
name = "whole"

[[log]]
path = "s3://bucket/wednesday.mcap"
"""


def test_a_manifest_gives_each_log_its_options(tmp_path: Path) -> None:
    """Paths are meant from its folder, options of a log go before those of all, and the same log may stand there twice
    with an output of its own.
    """
    file = tmp_path / "fleet.toml"
    elsewhere = tmp_path / "elsewhere" / "tuesday.mcap"
    file.write_text(MANIFEST.replace("{elsewhere}", str(elsewhere)))
    for log in (tmp_path / "logs" / "monday.mcap", elsewhere):
        log.parent.mkdir()
        log.touch()
    first, second, third, fourth = find_logs([str(file), str(file)])
    assert (first.place, first.name) == (tmp_path / "logs" / "monday.mcap", None)
    settings = ("--set", "localize.max_sigma_m=0.3", "--set", "fuse.bearing_gate=4")
    span = ("--start", "2026-01-31T12:00:00+00:00", "--end", "1769861000000000000")
    assert words_of(first.options) == ("--map", "site.db", "--odom", "/odom", *settings, *span)
    assert (second.place, second.name) == (elsewhere, "second")
    assert words_of(second.options) == ("--map", "site.db", "--odom", "/wheels", *settings, "--force")
    outputs = [output.name for _, output in outputs_in(tmp_path, [first, second, third, fourth], ".mcap")]
    assert outputs == ["monday.mcap", "second.mcap", "whole.mcap", "wednesday.mcap"]
    assert str(fourth.place) == "s3://bucket/wednesday.mcap"


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("log = ", "not a TOML file"),
        ("", "log is missing; list the logs, each below a line [[log]]"),
        ("log = []", "log is empty; list the logs"),
        ('log = "a.mcap"', "log = 'a.mcap': list the logs"),
        ('[[logs]]\npath = "a"', "logs is no key of a manifest; did you mean log?"),
        ('[[log]]\npath = "a"\n[[log]]\nname = "b"', '[[log]] 2: path is missing; name the log, such as path = "'),
        ('[[log]]\npath = "a"\nnmae = "b"', "[[log]] 1: nmae is no key of a manifest; did you mean name?"),
        ('[[log]]\npath = "a"\nname = "x/b"', "[[log]] 1: name = 'x/b': give the output's name without folders"),
        ('[[log]]\npath = "a"\nstart = 1.5', "[[log]] 1: start = 1.5: give RFC 3339 with an offset"),
        ('[[log]]\npath = "a"\nstart = "yesterday"', "[[log]] 1: start = yesterday: give RFC 3339 with an offset"),
        ('[[log]]\npath = "a"\nend = 2026-01-31T12:00:00', "[[log]] 1: end = 2026-01-31T12:00:00: give RFC 3339 with"),
        ('[[log]]\npath = "*.mcap"', "/*.mcap': patterns are for the command line; list each log"),
        ('[[log]]\npath = "s3://bucket/*"', "[[log]] 1: path = 's3://bucket/*': patterns are for the command line"),
        (
            '[[log]]\npath = "s3://bucket/logs/"',
            "path = 's3://bucket/logs/': prefixes are for the command line",
        ),
        ('[[log]]\npath = "none.mcap"', "/none.mcap': there is no such file; name it from the manifest's folder"),
        ('[[log]]\npath = "a"\n[log.options]\nset = { a = 1 }', "[[log]] 1: options.set = {'a': 1}: give a table of"),
    ],
)
def test_what_is_wrong_in_a_manifest_is_named_with_file_table_and_key(tmp_path: Path, text: str, said: str) -> None:
    file = tmp_path / "fleet.toml"
    file.write_text(text)
    with pytest.raises(UsageError) as refusal:
        find_logs([str(file)])
    assert str(refusal.value).startswith(f"{file}: ")
    assert said in str(refusal.value)
