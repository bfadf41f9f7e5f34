"""Ground that gives way: the Soil Contact Model on the samples of a height map, driven by contact forces."""
