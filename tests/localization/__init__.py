"""Tests of mcap_landmarks.localization."""
