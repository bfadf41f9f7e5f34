"""Several nodes on one terrain: how many bodies they carry."""
