"""The report's figures (Smart-Mesh, 2018, Appendix B), in milliseconds, measured on a 2009 iMac (Intel i7-860)."""

# Table 1: collider of the whole main mesh, by vertices on a side: PhysX (BVH rebuilt) and Bullet (BVH refitted).
SIMPLE_PHYSX = {3: 0.094, 5: 0.119, 25: 2.169, 50: 10.507, 100: 51.559, 150: 136.915, 200: 254.778}
SIMPLE_BULLET = {3: 0.025, 5: 0.057, 25: 0.964, 50: 3.431, 100: 13.090, 150: 29.049, 200: 51.814}

# Table 2: one local collider of 3 x 3 vertices, by vertices on a side of the main mesh.
SMART_PHYSX = {25: 0.171, 50: 0.178, 100: 0.176}
SMART_BULLET = {25: 0.120, 50: 0.118, 100: 0.120}

# Table 3: one local collider, by its rings (collider-size; 1 = 3 x 3).
LOCAL_VARYING = {1: 0.121, 2: 0.236, 3: 0.551, 4: 1.162}
LOCAL_CONSTANT = {1: 0.096, 2: 0.160, 3: 0.319, 4: 0.629}

# Table 4: nearest-vertex search of one body, by method and vertices on a side.
SEARCH = {
    "brute_force": {50: 0.463, 100: 1.776, 150: 3.783, 200: 6.673},
    "ray_cast": {50: 0.038, 100: 0.037, 150: 0.040, 200: 0.042},
    "best_first": {50: 0.010, 100: 0.011, 150: 0.011, 200: 0.012},
    "best_first_worst": {50: 0.183, 100: 0.343, 150: 0.480, 200: 0.617},
    "grid_traversal": {50: 0.010, 100: 0.010, 150: 0.011, 200: 0.012},
    "grid_traversal_worst": {50: 0.015, 100: 0.015, 150: 0.015, 200: 0.015},
}

# Table 5: collecting the vertices of one local collider, by method and rings.
COLLECT = {
    "queue_bfs": {1: 0.015, 2: 0.049, 3: 0.145, 4: 0.383},
    "union_bfs": {1: 0.009, 2: 0.039, 3: 0.086, 4: 0.167},
    "cached": {1: 0.002, 2: 0.002, 3: 0.002, 4: 0.002},
}

# Table 6: everything for one body, by vertices on a side; Simple-Mesh is that of PhysX.
FINAL_SIMPLE = {side: SIMPLE_PHYSX[side] for side in (50, 100, 150, 200)}
FINAL_GENERAL = {50: 0.601, 100: 1.799, 150: 3.768, 200: 6.563}
FINAL_UNIFORM = {50: 0.085, 100: 0.087, 150: 0.085, 200: 0.089}

# Sizes beyond the report's [vertices on a side].
LARGER = (512, 1024, 2048, 4096)
RINGS = (1, 2, 3, 4)
