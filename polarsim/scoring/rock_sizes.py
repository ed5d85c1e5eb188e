"""True sizes of measured rocks, from the ground truth of the analog."""

from __future__ import annotations

from pathlib import Path

from polarsim.formats.tables import read_parquet, typed, write_parquet
from polarsim.geometry.rock_axes import caliper_axes, exposed_mesh
from polarsim.photo import NO_ROCK, Terrain
from polarsim.run_files.scene import read_terrain
from polarsim.schemas.evaluation import TRUE_SIZES
from polarsim.scoring.alignment import read_alignment
from polarsim.scoring.rock_pairs import pair_rocks
from polarsim.site import Site

_CENTRES = ("rock", "x", "y", "z", "size_m")


def find_true_sizes(
    *, site: Site, terrain: Terrain, sizes: Path, rocks: Path, located: Path, truth: Path, true_sizes: Path
) -> None:
    """Write the true sizes of the measured rocks that match a true rock, see `TRUE_SIZES`.

    `rocks`: table of detected rocks. `located`: folder of the camera poses, which align the frames of run and truth.
    `truth`: folder truth/TerrainTT of the analog.
    """
    measured = set(read_parquet(sizes, ["rock"])["rock"])
    true, found = (read_parquet(path, _CENTRES) for path in (truth / "rocks.parquet", rocks))
    pairs = pair_rocks(true, found, read_alignment(located, truth))
    scene = read_terrain(truth / "meshes", terrain, site.sandbox_of(terrain))
    ground = scene.part(NO_ROCK).vertices
    rows = []
    for true_rock, rock in zip(true["rock"].iloc[pairs.true], found["rock"].iloc[pairs.found], strict=True):
        if rock not in measured:
            continue
        mesh = scene.part(int(true_rock))
        exposed, volume = exposed_mesh(mesh, ground)
        whole = caliper_axes(mesh.vertices).lengths
        rows.append(
            {
                "rock": rock, "true_rock": true_rock,
                **dict(zip(("true_a_m", "true_b_m", "true_c_m"), exposed.axes.lengths, strict=True)),
                "true_height_m": exposed.height, "true_diameter_m": exposed.diameter, "true_volume_m3": volume,
                **dict(zip(("whole_a_m", "whole_b_m", "whole_c_m"), whole, strict=True)),
            }
        )  # fmt: skip
    table = typed(rows, TRUE_SIZES)
    lengths = {name: 4 for name in TRUE_SIZES.columns if name.endswith("_m")}
    write_parquet(true_sizes, table.round({**lengths, "true_volume_m3": 7}).sort_values("rock", ignore_index=True))
