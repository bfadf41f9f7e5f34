"""Several nodes on one terrain: capacity, accuracy of collisions between their bodies, and faults."""
