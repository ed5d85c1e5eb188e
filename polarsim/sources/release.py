"""The published labels, rock meshes and cover photos; without photos and scans."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path

from polarsim.download import exclusive_lock
from polarsim.errors import FormatError
from polarsim.formats import release
from polarsim.grid import GridOptions
from polarsim.photo import Terrain, terrain_text
from polarsim.run_files.inventory import Inventory
from polarsim.site import Site
from polarsim.sources.source import TerrainContent, path_texts, relative_names

_FOLDERS = (release.BOXES, release.POLYGONS, release.MESHES, release.COVERS)


class ReleaseSource:
    """Published annotations, and rock meshes made from scans."""

    domain = "real"
    has_photos = False
    has_scans = False
    is_generated = False

    def layout(self, site: Site) -> re.Pattern[str]:  # noqa: ARG002
        """Return the names of the top folders of archives."""
        return re.compile("|".join(_FOLDERS))

    def expected(self, site: Site, terrain: Terrain) -> str:  # noqa: ARG002
        """Return the names of the folders of a terrain."""
        root = Path()
        folders = (release.label_folder(root, terrain), release.mesh_folder(root, terrain))
        return " and ".join(folder.as_posix() for folder in folders)

    def folders(self, site: Site, root: Path, terrain: Terrain) -> list[Path]:  # noqa: ARG002
        """Return the folders of boxes, polygons and meshes."""
        of = (release.label_folder, release.polygon_folder, release.mesh_folder)
        return [folder for find in of if (folder := find(root, terrain)).is_dir()]

    def inputs(self, site: Site, root: Path, terrain: Terrain) -> list[Path]:  # noqa: ARG002
        """Return the meshes of rocks and ground."""
        ground = release.ground_file(root, terrain)
        return [*release.released_meshes(root, terrain).values(), *([ground] if ground else [])]

    def index(
        self,
        site: Site,
        root: Path,
        terrain: Terrain,
        positions: Sequence[str],  # noqa: ARG002
        grid: GridOptions,  # noqa: ARG002
    ) -> TerrainContent:
        """Return the inventory of a terrain, and no photos."""
        folders = (release.label_folder(root, terrain), release.mesh_folder(root, terrain))
        if not any(folder.is_dir() for folder in folders):
            raise FormatError(
                f"no data of terrain {terrain_text(terrain)}, expected {self.expected(site, terrain)}", path=root
            )
        stray = release.stray_files(root, terrain, site.key)
        release.log_strays(stray, f"{root}, terrain {terrain_text(terrain)}")
        ground = release.ground_file(root, terrain)
        inventory = Inventory(
            terrain,
            "release",
            meshes=path_texts(release.released_meshes(root, terrain)),
            ground=ground.as_posix() if ground else "",
            cover_photos=path_texts(release.cover_photos(root, terrain)),
            stray=relative_names(root, stray),
        )
        return TerrainContent(inventory, [])

    def truth(self, root: Path, terrain: Terrain) -> Path | None:  # noqa: ARG002
        """Return None: the real sandbox has no ground truth."""
        return None

    def unpacked(self, site: Site, root: Path, terrain: Terrain) -> Path | None:  # noqa: ARG002
        """Return None: folders of a release are shared by all terrains."""
        return None

    def arrange(self, unpacked: Path, root: Path) -> None:
        """Move the folders of the release into the root, unless they exist in the root."""
        with exclusive_lock(root):
            for name in _FOLDERS:
                for folder in (*unpacked.glob(name), *unpacked.glob(f"*/{name}")):
                    if not (root / name).exists():
                        folder.rename(root / name)

    def check_fetched(self, site: Site, root: Path, terrain: Terrain, files: Sequence[Path]) -> None:
        """Accept any files of the terrain."""
