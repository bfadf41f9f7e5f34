"""Several nodes on one terrain as one: a front that gives each body to a node, and keeps them when a node dies."""
