"""Settings: files, single settings, and what an unknown one is answered."""

from pathlib import Path

import pytest

from toolkit.errors import UsageError
from toolkit.runs.config import effective, gather, load


def test_a_setting_goes_over_the_file(tmp_path: Path) -> None:
    file = tmp_path / "config.toml"
    file.write_text("[localize]\nmax_sigma_m = 0.2\nrobust_dof = 3\n")
    config = load("localize", gather(file, ["localize.max_sigma_m=0.3"], None))
    assert (config.max_sigma_m, config.robust_dof) == (0.3, 3.0)
    assert effective(config)["max_sigma_m"] == 0.3


def test_method_counts_for_every_stage() -> None:
    settings = gather(None, ["localize.method=default"], "thesis")
    assert load("localize", settings).method == "default"
    assert load("build_map", settings).method == "thesis"


@pytest.mark.parametrize(
    ("settings", "words"),
    [
        (["localize.max_sigm_m=1"], "did you mean max_sigma_m"),
        (["localise.max_sigma_m=1"], "did you mean localize"),
        (["max_sigma_m=1"], "write STAGE.KEY=VALUE"),
        (["localize.max_sigma_m=wide"], "localize.max_sigma_m = 'wide'"),
        (["localize.method=magic"], "'default' or 'thesis'"),
    ],
)
def test_wrong_settings_name_the_remedy(settings: list[str], words: str) -> None:
    with pytest.raises(UsageError, match=words):
        load("localize", gather(None, settings, None))


@pytest.mark.parametrize(("text", "words"), [("x = 1", "outside a stage's table"), ("[", "not a TOML file")])
def test_wrong_files_name_the_remedy(tmp_path: Path, text: str, words: str) -> None:
    file = tmp_path / "config.toml"
    file.write_text(text)
    with pytest.raises(UsageError, match=words):
        gather(file, [], None)
    with pytest.raises(UsageError, match="no such configuration file"):
        gather(tmp_path / "no.toml", [], None)
