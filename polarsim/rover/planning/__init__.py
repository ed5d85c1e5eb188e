"""Autonomous drives with a path planned by the rover.

Steps in order: `cases` (the drives of a run), `planner` (a path between hazards), `pilot` (decisions during a drive),
`drive` (a drive and its files), `clearance` (distance from rocks), `metrics` (a drive and the score of its map),
`summary` (all drives), `rank` (ranking of detectors by gap and by drives).
"""
