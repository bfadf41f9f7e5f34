"""What the node answers: services for bodies and for the simulation."""
