"""How well engines keep the laws of contact, and how far runs drift apart that start a micrometre apart."""
