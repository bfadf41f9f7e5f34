"""Example terrain for demos, tests and studies."""
