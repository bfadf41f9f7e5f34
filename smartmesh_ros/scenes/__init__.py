"""Example terrain for demos, tests and studies."""

# Scenes of the node terrain_source.
SCENES = ("waves", "rut", "crater", "heave", "elevation")
