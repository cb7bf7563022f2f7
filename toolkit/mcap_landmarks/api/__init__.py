"""The Python API: what the verbs do and what logs hold, for notebooks and scripts; `mcap_landmarks` has its names."""

from mcap_landmarks import memory

memory.bound_images()
