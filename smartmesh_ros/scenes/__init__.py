"""Ground to try things on."""
