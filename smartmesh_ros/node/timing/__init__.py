"""Timing of the node's loop: clocks, pacing and lateness."""
