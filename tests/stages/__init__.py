"""Tests of toolkit.stages."""
