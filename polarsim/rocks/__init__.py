"""Stage 3, scans to rocks and ground: clouds, cuboids and meshes."""
