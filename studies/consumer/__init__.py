"""MuJoCo drives a rover on patches from a ``terrain_collider``; compared with MuJoCo on a field of the whole map."""
