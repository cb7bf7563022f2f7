"""Tests of mcap_landmarks.geometry."""
