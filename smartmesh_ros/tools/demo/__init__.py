"""The terrain source and the demo."""
