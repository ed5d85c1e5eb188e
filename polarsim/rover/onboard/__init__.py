"""What a detector finds in the pictures of a drive, and what that is worth to the rover."""
