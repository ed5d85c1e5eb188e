"""Drives in which the rover finds its own way.

Steps in order: `cases` (which drives a run has), `planner` (a path between hazards), `pilot` (decisions along the way),
`drive` (one drive), `pictures` (what the front camera showed), `touches` (rocks touched), `challenge` (points of the
map), `odometry` and `trajectory` (visual odometry and its error), `metrics` (a drive), `summary` (all drives), `rank`
(detectors by gap and by drives).
"""
