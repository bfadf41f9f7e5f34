"""Physics engines behind one interface: the same bodies on the same moving ground, to measure side by side."""
