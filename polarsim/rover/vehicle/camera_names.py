"""Names of cameras of the vehicle that options and steps refer to."""

FRONT = "front_end_cam"
FOLLOWING = ("CamBirdViewLeft", "CamBirdViewRight")  # do not roll with the rover
