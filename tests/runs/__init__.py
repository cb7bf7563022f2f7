"""Tests of toolkit.runs."""
