"""Protocol of a data source."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

from polarsim.grid import GridOptions
from polarsim.photo import PhotoKey, Terrain
from polarsim.run_files.inventory import Inventory
from polarsim.site import Site


@dataclass(frozen=True)
class TerrainContent:
    """Raw data of a terrain."""

    inventory: Inventory
    photos: Sequence[tuple[PhotoKey, Path]]  # of the positions of the run


class DataSource(Protocol):
    """Layout and properties of the raw data below `source.root`.

    `root` is `source.root`. Methods find files; the acquire stage reads the files.
    """

    domain: str  # of the photos, in tables: `real` or `analog`
    has_photos: bool
    has_scans: bool  # False: rock meshes are published
    is_generated: bool  # by the workflow, with ground truth; labels are simulated, not annotated

    def layout(self, site: Site) -> re.Pattern[str]:
        """Return the names of the top folders; other single top folders of an archive are removed."""
        ...

    def expected(self, site: Site, terrain: Terrain) -> str:
        """Return the names of the folders of a terrain, for messages."""
        ...

    def folders(self, site: Site, root: Path, terrain: Terrain) -> list[Path]:
        """Return the folders below the root with data of a terrain."""
        ...

    def inputs(self, site: Site, root: Path, terrain: Terrain) -> list[Path]:
        """Return the input files for Snakemake, without label files and photos, which are too many."""
        ...

    def index(
        self, site: Site, root: Path, terrain: Terrain, positions: Sequence[str], grid: GridOptions
    ) -> TerrainContent:
        """Return the inventory and the photos of a terrain.

        `grid` is the part of the photo grid whose missing photos are reported.
        """
        ...

    def truth(self, root: Path, terrain: Terrain) -> Path | None:
        """Return the folder of the ground truth; None without ground truth."""
        ...

    def unpacked(self, site: Site, root: Path, terrain: Terrain) -> Path | None:
        """Return the folder to which an archive named for a terrain was unpacked; None if there is no such folder."""
        ...

    def arrange(self, unpacked: Path, root: Path) -> None:
        """Move the folders of an unpacked archive to the expected folders below the root."""
        ...

    def check_fetched(self, site: Site, root: Path, terrain: Terrain, files: Sequence[Path]) -> None:
        """Raise a `FetchError` if no file of a terrain is usable after a download."""
        ...


def path_texts(files: Mapping[str, Path] | Mapping[int, Path]) -> dict[str, str]:
    """Return the files of an inventory by name."""
    return {str(name): path.as_posix() for name, path in files.items()}


def relative_names(root: Path, files: Sequence[Path]) -> tuple[str, ...]:
    """Return the sorted names of files relative to the root."""
    return tuple(sorted(path.relative_to(root).as_posix() for path in files))
