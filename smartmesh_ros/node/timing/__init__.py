"""When the node steps: clocks, pacing, and how late it runs."""
