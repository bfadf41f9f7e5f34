"""How well bodies follow a scene's ground: scenes, references, measures. Shared by the tuner and the studies."""
