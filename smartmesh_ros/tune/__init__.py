"""What accuracy costs on a user's own terrain and bodies, and the parameters that give most of it within a budget."""
