"""Starting: executables, launch files, DDS settings and domains."""
