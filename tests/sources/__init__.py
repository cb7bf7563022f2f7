"""Tests of mcap_landmarks.sources."""
