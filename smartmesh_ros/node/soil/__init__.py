"""The node ``soil``: ground that gives way under the bodies of a terrain_collider."""
