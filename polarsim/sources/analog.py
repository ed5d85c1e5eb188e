"""The simulated sandbox, which the workflow generates in the layout of the site."""

from __future__ import annotations

from pathlib import Path

from polarsim.photo import Terrain, terrain_text
from polarsim.sources.files import FilesSource


class AnalogSource(FilesSource):
    """Photos, scans and ground truth of the simulated sandbox."""

    kind = "analog"
    domain = "analog"
    is_generated = True

    def truth(self, root: Path, terrain: Terrain) -> Path | None:
        """Return the folder of the ground truth."""
        return root / "truth" / f"Terrain{terrain_text(terrain)}"
