"""The report's patches: a fixed number of rings around the nearest vertex, found and collected by its methods."""
