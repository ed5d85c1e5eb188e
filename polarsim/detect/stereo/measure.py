"""Stereo depth of all image pairs of a terrain in each domain, and its IPD between domains."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import asdict, replace
from itertools import combinations
from pathlib import Path

import numpy as np
import pandas as pd

from polarsim.detect import tone
from polarsim.detect.ipd import IpdRules, instance_performance_difference
from polarsim.detect.options import ComparisonOptions, StereoOptions
from polarsim.detect.pictures import picture_paths
from polarsim.detect.stereo.match import match_stereo
from polarsim.detect.stereo.rectify import Rectification, rectify
from polarsim.detect.stereo.truth import depth_range, depth_truth, rock_performance, score_depth
from polarsim.errors import DetectError, with_path
from polarsim.formats import png, tables
from polarsim.geometry.casters import make_caster
from polarsim.photo import ROCK, PhotoKey, Terrain
from polarsim.progress import track
from polarsim.run_files.rigs import read_all_localised
from polarsim.run_files.scene import read_terrain
from polarsim.schemas.detect import STEREO, STEREO_INSTANCES, STEREO_IPD
from polarsim.site import Site

PAIR_COLUMNS, ROCK_COLUMNS = STEREO.columns, STEREO_INSTANCES.columns


def measure_stereo(
    *,
    site: Site,
    terrain: Terrain,
    keys: Iterable[PhotoKey],
    cameras: Path,
    meshes: Path,
    pictures: Mapping[str, Path],
    pairs: Path,
    rocks: Path,
    options: StereoOptions,
    threads: int,
) -> None:
    """Compute stereo depth of each pair of images of a terrain; write a row per pair and a row per rock.

    Parameters
    ----------
    cameras, meshes : Path
        Folders of the terrain.
    pictures : mapping of str to Path
        Table of photos or folder of twins by domain, see `pictures.picture_paths`.
    pairs, rocks : Path
        Parquet files to write, `PAIR_COLUMNS` and `ROCK_COLUMNS`; key is the key of the left photo.
    """
    import cv2

    cv2.setNumThreads(threads)
    chosen = [key for key in sorted(keys) if not options.exposures_ms or key.exposure_ms in options.exposures_ms]
    localised, mesh = read_all_localised(cameras), read_terrain(meshes, terrain, site.sandbox_of(terrain))
    surfaces = make_caster(mesh.vertices, mesh.faces, threads=threads)
    by_domain = {domain: picture_paths(folder, chosen) for domain, folder in pictures.items()}
    pair_rows, rock_rows = [], []
    for position in sorted(set(localised) & {key.position for key in chosen}):
        with with_path(cameras / f"Pos{position}.json"):
            rig = rectify(localised[position].rig, options.scale)
        truth = depth_truth(mesh, surfaces, localised[position], rig)
        depths = depth_range(truth)
        work = [
            (domain, left, paths[left], paths[right])
            for domain, paths in by_domain.items()
            for left, right in _pairs(paths)
            if left.position == position
        ]
        for domain, key, left_path, right_path in track(work, f"stereo {position}"):
            left, right = (_picture(path, rig) for path in (left_path, right_path))
            depth = match_stereo(left, right, rig, *depths)
            name = {"domain": domain} | tables.key_columns(key)
            pair_rows.append(name | score_depth(depth, truth))
            rock_rows += [name | row for row in rock_performance(depth, truth)]
    if not pair_rows:
        raise DetectError(f"terrain {terrain} has no stereo pair of images", path=cameras)
    _write(pairs, pair_rows, PAIR_COLUMNS)
    _write(rocks, rock_rows, ROCK_COLUMNS)


def _pairs(paths: Mapping[PhotoKey, Path]) -> list[tuple[PhotoKey, PhotoKey]]:
    """Return pairs of left and right photos that both exist."""
    lefts = [(key, replace(key, camera="R")) for key in paths if key.camera == "L"]
    return [(left, right) for left, right in lefts if right in paths]


def _picture(path: Path, rig: Rectification) -> np.ndarray:
    """Read a photo, reduce it, and convert it to 8 bits by the tone curve of detectors."""
    with with_path(path):
        pixels = png.read_photo(path, None)
    return tone.to_8_bits(tone.shrink(pixels, max(rig.lens.width, rig.lens.height)))


def _write(path: Path, rows: list[dict[str, object]], columns: tuple[str, ...]) -> None:
    tables.write_parquet(path, stereo_table(pd.DataFrame(rows, columns=list(columns))))


def stereo_table(table: pd.DataFrame) -> pd.DataFrame:
    """Set types, round, and sort by domain and photo."""
    for name in ("domain", "key", "position", "light", "azimuth"):
        if name in table.columns:
            table[name] = table[name].astype("str")
    order = [name for name in ("domain", "key", "rock") if name in table.columns]
    return table.round(6).sort_values(order, kind="stable", ignore_index=True)


def compare_stereo(
    *, pairs: list[Path], rocks: list[Path], stereo: Path, instances: Path, ipd: Path, options: ComparisonOptions
) -> None:
    """Merge the tables of `measure_stereo` of all terrains, and write the IPD of every pair of domains.

    The performance of a rock is the share of its pixels with correct depth. It replaces the IoU of detectors.
    """
    tables.write_parquet(stereo, stereo_table(pd.concat([tables.read_parquet(path, PAIR_COLUMNS) for path in pairs])))
    performances = stereo_table(pd.concat([tables.read_parquet(path, ROCK_COLUMNS) for path in rocks]))
    tables.write_parquet(instances, performances)
    by_domain = {
        str(domain): rows.rename(columns={"performance": "iou"}).assign(kind=ROCK)
        for domain, rows in performances.groupby("domain")
    }
    differences = [
        {"first": first, "second": second}
        | asdict(
            instance_performance_difference(
                by_domain[first],
                by_domain[second],
                rules=IpdRules(unit=options.resampled),
                resamples=options.resamples,
            )
        )
        for first, second in combinations(sorted(by_domain), 2)
    ]
    tables.write_parquet(ipd, pd.DataFrame(differences, columns=list(STEREO_IPD.columns)).round(6))
