"""Table of the rover's parts, and poses of the cameras."""
