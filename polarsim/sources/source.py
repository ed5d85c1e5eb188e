"""Protocol of a data source."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

from polarsim.grid import GridOptions
from polarsim.photo import PhotoKey
from polarsim.run_files.inventory import Inventory


@dataclass(frozen=True)
class TerrainContent:
    """Raw data of one terrain."""

    inventory: Inventory
    photos: Sequence[tuple[PhotoKey, Path]]  # of the run's positions


class DataSource(Protocol):
    """Layout and properties of the raw data below `source.root`.

    Methods take the root and the number of a terrain. They read the layout; the acquire stage reads the files.
    """

    domain: str  # of the photos, in tables: `real` or `analog`
    has_photos: bool
    has_scans: bool  # else rock meshes are published
    is_generated: bool  # by the workflow, with ground truth; labels in it are not drawn by people
    layout: re.Pattern[str]  # names of the top folders; other single top folders of an archive are removed

    def expected(self, terrain: int) -> str:
        """Return the names of the folders that a terrain has, for messages."""
        ...

    def folders(self, root: Path, terrain: int) -> list[Path]:
        """Return the folders below the root that hold data of a terrain."""
        ...

    def inputs(self, root: Path, terrain: int) -> list[Path]:
        """Return the files that Snakemake watches, without photos, which are too many, and label files."""
        ...

    def index(self, root: Path, terrain: int, positions: Sequence[str], grid: GridOptions) -> TerrainContent:
        """Return the inventory and the photos of a terrain.

        `grid` is the part of the photo grid whose missing photos are reported.

        Raises
        ------
        FormatError
            The root has nothing of the terrain.
        """
        ...

    def truth(self, root: Path, terrain: int) -> Path | None:
        """Return the folder of the ground truth; None without ground truth."""
        ...

    def unpacked(self, root: Path, terrain: int) -> Path | None:
        """Return the folder to which an archive named for a terrain was unpacked; None if there is no such folder."""
        ...

    def arrange(self, unpacked: Path, root: Path) -> None:
        """Move the folders of an unpacked archive to their place below the root."""
        ...

    def check_fetched(self, root: Path, terrain: int, files: Sequence[Path]) -> None:
        """Check the files of a terrain after a download.

        Raises
        ------
        FetchError
            None of the files is usable.
        """
        ...


def path_texts(files: Mapping[str, Path] | Mapping[int, Path]) -> dict[str, str]:
    """Return the files of an inventory by name."""
    return {str(name): path.as_posix() for name, path in files.items()}


def below(root: Path, files: Sequence[Path]) -> tuple[str, ...]:
    """Return the sorted names of files relative to the root."""
    return tuple(sorted(path.relative_to(root).as_posix() for path in files))
