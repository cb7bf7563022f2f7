"""Measurements: `python -m tests.benchmark.NAME [--json] [--quick]`."""
