"""The toolkit's command line, but for logs that are named to hang. What its verbs import is loaded here, so that no
time limit of a test counts that.
"""

import time

import mcap_landmarks.cli.localize  # what is loaded is loaded
import mcap_landmarks.runs.pipeline
import mcap_landmarks.stages.localize  # noqa: F401
from mcap_landmarks.cli.main import run


def run_or_hang(words: list[str]) -> None:
    """Run a verb, or wait for ever where its log's name says so."""
    if "hangs" in words[1]:
        time.sleep(3600)
    run(words)
