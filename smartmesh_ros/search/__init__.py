"""Nearest-vertex search: find the sample of the main mesh under a body. Imports the terrain room only."""
