"""Patches: which samples make the local collider of a body. Needs the terrain and search rooms only."""
