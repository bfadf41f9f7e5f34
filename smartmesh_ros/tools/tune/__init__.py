"""Search for parameters that meet limits of cost and accuracy on a user's terrain and bodies; docs/tuning.md."""
