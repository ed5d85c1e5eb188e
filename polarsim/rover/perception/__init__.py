"""Detections, maps and measurements from the rover's pictures.

Steps in order: `detections` (boxes of a detector and visible labels), `ground_view` (boxes to positions on the ground,
cells of maps), `map_updates` (boxes, pixels or depths to cells), `hazard_grid` (map of an autonomous drive),
`observation` (pictures at a time to updates of that map), `hazard_map` (estimated and true rock cells of a recorded
drive), `sightings` (when rocks are detected), `measure` (tables of a drive), `summary` (all drives), `fine_tuning`
(training).
"""
