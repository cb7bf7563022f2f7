"""Tests of mcap_landmarks.cli."""
