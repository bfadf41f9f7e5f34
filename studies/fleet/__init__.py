"""Several nodes on one terrain: what they carry together, how well their bodies meet, and what faults do to them."""
