"""Files of a run that several stages share, with reader and writer.

- Terrain: `inventory` (raw files), `scans` (points), `rigs` and `lamps` (poses), `scene` (meshes),
  `rock_translations`, `materials` (fitted albedo).
- Run: `run` (photos, domains, models, splits, labels and drives in the folder of a run).
- Photos and twins: `pictures` (files by photo key), `best_photos`, `picture_sets` (names), `instances` and
  `class_masks` (label maps).

Formats that other programs define are in `polarsim.formats`, the columns of tables in `polarsim.schemas`.
"""

from polarsim.public import lazy_exports

__all__, __getattr__, __dir__ = lazy_exports(
    __name__,
    LocalisedRig="rigs",
    read_localised="rigs",
    write_localised="rigs",
    read_terrain="scene",
    Run="run",
)
