"""The code of another folder against this one's: speed and penetration of both, taken in turns in one run."""
