"""Tests of toolkit.geometry."""
