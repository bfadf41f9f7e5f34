"""The core in C++: the reader of moving ground, contacts of convex shapes with it, and PyBullet's plugin."""
