"""Tests of images, networks and boxes."""
