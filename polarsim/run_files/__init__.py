"""Files of a run that several stages share, each with its reader and writer, and what is chosen from such files.

- Terrain: `inventory` (raw files), `scans` (points of its scans), `rigs` and `lamps` (poses), `scene` (meshes),
  `rock_translations`, `materials` (fitted albedo).
- A run as a whole: `run` (which photos, domains, models, splits, labels and drives its folder has).
- Photos and twins: `pictures` (files by photo key), `best_photos`, `picture_sets` (names), `instances` and
  `class_masks` (what pixels show).

Formats that other programs define are in `polarsim.formats`, the columns of tables in `polarsim.schemas`.
"""

from polarsim.public import offered

__all__, __getattr__, __dir__ = offered(
    __name__,
    LocalisedRig="rigs",
    read_localised="rigs",
    write_localised="rigs",
    read_terrain="scene",
    Run="run",
)
