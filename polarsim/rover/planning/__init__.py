"""Autonomous drives with a path planned by the rover.

Steps in order: `cases` (the drives of a run), `planner` (a path between hazards), `pilot` (decisions during a drive),
`drive` (a drive), `pictures` (images of the front camera), `contacts` (touched rocks), `challenge` (score of the map),
`odometry` and `trajectory` (visual odometry and its error), `metrics` (a drive), `summary` (all drives), `rank`
(ranking of detectors by gap and by drives).
"""
