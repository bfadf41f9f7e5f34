"""A source of terrain, and the demo."""
