"""Services of the node: for bodies and for the simulation."""
