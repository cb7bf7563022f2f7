"""Tests of the objects, grounds and skies."""
