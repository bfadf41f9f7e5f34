"""What the node publishes: patches, bodies, robots, the clock, diagnostics."""
