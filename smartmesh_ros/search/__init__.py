"""Nearest-vertex search: which sample of the main mesh lies under a body. Needs the terrain room only."""
