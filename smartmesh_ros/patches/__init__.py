"""Patches: which samples of the terrain form the local collider of a body. Imports the terrain and search rooms
only."""
