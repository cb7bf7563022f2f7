"""Tests of mcap_landmarks.evaluation."""
