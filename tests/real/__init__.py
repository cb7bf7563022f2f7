"""The main job on data that others recorded."""
