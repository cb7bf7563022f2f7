"""Runs: what a verb does, from files to files."""
