"""`python -m mcap_landmarks`: the command, for an interpreter whose scripts are not on the path."""

from mcap_landmarks.cli.main import run

run()
