"""Measurement of accuracy: scenes, reference runs and measures. Shared by the tuner and the studies."""
