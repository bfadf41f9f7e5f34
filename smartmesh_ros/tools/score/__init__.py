"""Maps of a mapper against the true ground: what they are worth."""
