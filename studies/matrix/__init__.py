"""The stability matrix: tests in which colliders of moving ground may fail, for each method."""
