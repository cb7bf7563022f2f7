"""Tests of mcap_landmarks.diff."""
