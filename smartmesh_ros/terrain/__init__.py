"""The main mesh: height maps, their sampling and their motion. Needs NumPy only."""
