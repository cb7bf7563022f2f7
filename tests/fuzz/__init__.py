"""Fuzzing with atheris: bytes that nobody would write, for every reader; `python -m tests.fuzz.run`."""
