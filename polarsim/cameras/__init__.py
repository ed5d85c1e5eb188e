"""Stage 2, scans or labels to rig poses: where the cameras stood in the sandbox."""
