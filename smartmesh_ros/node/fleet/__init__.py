"""A fleet: several nodes on one terrain behind one front, which assigns bodies to nodes and respawns the bodies of a
node that dies."""
