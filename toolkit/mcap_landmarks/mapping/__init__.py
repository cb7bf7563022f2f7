"""Observations to a map (landmark SLAM): data association, log merging, initialisation, noise, solving."""
