"""Files of terrain and robots."""
