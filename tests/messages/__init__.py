"""Tests of mcap_landmarks.messages."""
