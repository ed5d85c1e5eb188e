"""Measurements and detections from the rover's pictures.

Steps in order: `contrast` (labels that a picture shows), `detections` (boxes of a detector), `ground_view` (boxes to
positions on the ground), `map_updates` (boxes, pixels or depths to cells), `hazard_grid` (the map of a drive),
`observation` (pictures of a moment to updates of the map), `hazard_map` (estimated and true rock cells), `sightings`
(when rocks are detected), `measure` (tables of a drive), `summary` (all drives), `fine_tuning` (training on drives).
"""
