"""Comparison of this code with that of another folder: speed and penetration, measured in turns in one run."""
