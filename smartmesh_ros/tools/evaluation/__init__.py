"""Measurement of accuracy: scenes and measures. Shared by the tuner and the studies."""
