"""Robot descriptions (URDF): checked as a whole, and prepared for PyBullet outside the simulation's loop."""
