"""Tests of mcap_landmarks.inspection."""
