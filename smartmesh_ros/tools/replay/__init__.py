"""The collider, fed from a recording in this process: without DDS, without an executor and without a wall clock."""
