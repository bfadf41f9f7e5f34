"""The physics engines of the reference runs."""
