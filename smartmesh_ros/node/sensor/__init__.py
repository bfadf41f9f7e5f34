"""Sensors of the ground: a lidar and a depth camera."""
