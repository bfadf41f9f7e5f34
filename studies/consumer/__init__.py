"""MuJoCo drives a rover on patches that a ``terrain_collider`` serves, beside MuJoCo with a field of the whole map."""
