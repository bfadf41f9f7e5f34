"""A complete simulation: bodies, robots, joints, snapshots, bodies of other nodes."""
