"""Start of the nodes: executables, launch files, DDS settings and domains."""
