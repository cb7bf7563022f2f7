"""Procedural objects, grounds and skies of the simulated worlds."""
