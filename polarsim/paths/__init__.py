"""Paths and options of jobs that depend on the configuration and on wildcards.

Rule files contain literal paths where possible. Other paths are computed by methods of these classes. Snakemake calls a
method with the argument `wildcards` for each job. Paths of a method without `wildcards` may contain wildcards such as
`{run}`.

- `RunPaths` (`run`): tables, figures and pages; based on `terrains` (raw data, stages up to the twins) and `detectors`
- `GapPaths` (`gap`): the ablation
- `CoverPaths` (`covers`): cover photos and randomised scenes
- `RoverPaths` (`rover`): drives of the rover
"""

from polarsim.paths.covers import CoverPaths
from polarsim.paths.gap import GapPaths
from polarsim.paths.rover import RoverPaths
from polarsim.paths.run import RunPaths
from polarsim.paths.wildcards import memory_per_attempt

__all__ = ["CoverPaths", "GapPaths", "RoverPaths", "RunPaths", "memory_per_attempt"]
