"""Tests of toolkit.messages."""
