"""Stages that tests put beside those of the toolkit."""
