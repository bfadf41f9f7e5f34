"""Reading of terrain and robot files."""
