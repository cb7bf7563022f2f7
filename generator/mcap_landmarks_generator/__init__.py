"""Simulated recordings with known truth: worlds, sensors, robot, and the detector's training set."""
