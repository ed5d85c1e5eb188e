"""Relief of the ground from photos: height maps with their uncertainty and origin."""
