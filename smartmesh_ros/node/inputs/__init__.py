"""What the node takes: terrain, bodies, transforms, joint commands, and how their messages are read."""
