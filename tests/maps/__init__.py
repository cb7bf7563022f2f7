"""Tests of mcap_landmarks.maps."""
