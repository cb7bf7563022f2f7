"""Tests of `mcap_landmarks.fleet`."""
