"""Tests of mcap_landmarks.runs."""
