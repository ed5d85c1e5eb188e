"""What a judge finds in the pictures of a drive, and what that is worth to the rover."""
