"""Tests of the detector families."""
