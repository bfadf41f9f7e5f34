"""Robots on rough and moving ground: cost and accuracy of this package beside whole colliders and other engines."""
