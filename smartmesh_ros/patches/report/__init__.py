"""The report's patches: a fixed number of rings around the nearest vertex, found by the report's search and collect
methods."""
