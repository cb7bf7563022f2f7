"""Tests of mcap_landmarks.report."""
