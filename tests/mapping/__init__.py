"""Tests of mcap_landmarks.mapping."""
