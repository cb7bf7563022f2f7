"""Inputs made to harm: what a file claims is never believed before it is checked."""
