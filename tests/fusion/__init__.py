"""Tests of mcap_landmarks.fusion."""
