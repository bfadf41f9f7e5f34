"""What the view costs the node that it shows, and itself."""
