"""Tests of mcap_landmarks.stages."""
