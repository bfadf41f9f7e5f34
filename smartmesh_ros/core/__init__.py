"""The compiled core: the reader of moving ground, contacts of convex shapes with it, and PyBullet's plugin. C++ only."""
