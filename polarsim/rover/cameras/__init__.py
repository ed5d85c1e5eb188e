"""What the rover's cameras see on a drive: the scene, its light, the pictures and their exact labels."""
