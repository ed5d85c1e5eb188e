"""Metrics of individual meshes: topology, contact with the ground, decimated copy, and distance to the true surface."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pandas as pd

from polarsim.formats import obj
from polarsim.geometry.meshes import Mesh
from polarsim.geometry.topology import is_watertight, part_of_face
from polarsim.photo import NO_ROCK, Terrain
from polarsim.run_files.scene import TerrainMesh, mesh_origins
from polarsim.schemas.evaluation import MESH_SCORES
from polarsim.scoring.surface import Surface
from polarsim.scoring.true_surface import SurfaceSamples

COLUMNS = MESH_SCORES.dtypes
SECTORS = 72  # around a rock; the rock must touch the ground in each sector
CONTACT = 0.002  # metres; maximum gap between a rock and the ground in contact
F_DISTANCE = 0.005  # metres; maximum distance of corresponding surfaces


def mesh_table(rows: list[dict[str, object]]) -> pd.DataFrame:
    """Return rows as a table with `COLUMNS`; missing values are NaN."""
    table = pd.DataFrame(rows, columns=list(COLUMNS))
    return table.astype(COLUMNS).round({name: 6 for name, kind in COLUMNS.items() if kind == "float64"})


def soundness_rows(
    scene: TerrainMesh, folder: Path, terrain: Terrain, rng: np.random.Generator, samples: int
) -> list[dict[str, object]]:
    """Return a row for the ground and for every rock of a scene, sorted by id. The folder has the decimated copies."""
    ground = scene.part(NO_ROCK)
    level = Surface(ground.vertices, ground.faces)
    sources = mesh_origins(folder)
    rows = [_named(obj.ground_name(terrain), NO_ROCK, ground, sources)]
    for rock, path in obj.rock_files(folder).items():
        mesh = scene.part(rock)
        row = {**_named(path.name, rock, mesh, sources), "contact_share": contact_share(mesh, level)}
        copy = path.with_name(obj.rock_name(terrain, rock, decimated=True))
        if copy.exists() and copy != path:
            row |= _copy_metrics(mesh, obj.read_obj(copy), rng, samples)
        rows.append(row)
    return rows


def accuracy(
    true: SurfaceSamples, reconstructed: SurfaceSamples, true_of_rock: Mapping[int, int]
) -> dict[int, dict[str, float]]:
    """Return metrics by reconstructed rock, and of the ground as `NO_ROCK`."""
    metrics = {}
    for rock, true_rock in {NO_ROCK: NO_ROCK, **true_of_rock}.items():
        of_true, of_rock = true.rock == true_rock, reconstructed.rock == rock
        if of_true.any():
            distance = true.distance[of_true]
            metrics[rock] = {
                "true_rock": float(true_rock),
                "surface_median_mm": 1000 * float(np.median(distance)),
                "surface_p90_mm": 1000 * float(np.percentile(distance, 90)),
                "f_score_5mm": f_score(distance, reconstructed.distance[of_rock]),
                "surface_iou": surface_iou(true, reconstructed, true_rock, rock),
            }
    return metrics


def surface_iou(true: SurfaceSamples, reconstructed: SurfaceSamples, true_rock: int, rock: int) -> float:
    """Return the visible area that belongs to both the true and the reconstructed rock over the area of the union."""
    of_true = true.rock == true_rock
    both = true.area[of_true & (true.other_rock == rock)].sum()
    only_reconstructed = reconstructed.area[
        (reconstructed.rock == rock) & (reconstructed.other_rock != true_rock)
    ].sum()
    return float(both / (true.area[of_true].sum() + only_reconstructed))


def f_score(true_distance: np.ndarray, distance: np.ndarray) -> float:
    """Return the F-score of two surfaces at 5 mm from the distances (n,), (m,) of samples to the other surface.

    Knapitsch et al., ACM ToG 36:78 (2017).
    """
    if not len(true_distance) or not len(distance):
        return float("nan")
    recall, precision = (true_distance < F_DISTANCE).mean(), (distance < F_DISTANCE).mean()
    return float(2 * recall * precision / (recall + precision)) if recall + precision else 0.0


def contact_share(rock: Mesh, ground: Surface) -> float:
    """Return the share of directions around a rock in which the mesh is at most 2 mm above the ground."""
    above = ground.height_below(rock.vertices)
    offset = rock.vertices[:, :2] - (rock.vertices[:, :2].min(axis=0) + rock.vertices[:, :2].max(axis=0)) / 2
    azimuth = np.arctan2(offset[:, 1], offset[:, 0])
    sector = np.minimum(((azimuth + np.pi) / (2 * np.pi) * SECTORS).astype(int), SECTORS - 1)
    lowest = np.full(SECTORS, np.inf)
    np.fmin.at(lowest, sector, above)  # NaN outside the ground
    return float((lowest[np.unique(sector)] < CONTACT).mean())


def _named(name: str, rock: int, mesh: Mesh, sources: Mapping[str, str]) -> dict[str, object]:
    return {"mesh": name, "rock": rock, "made_from": sources.get(name, ""), **_counts(mesh)}


def _counts(mesh: Mesh) -> dict[str, object]:
    corners = mesh.vertices[mesh.faces]
    edges = np.linalg.norm(corners - np.roll(corners, -1, axis=1), axis=-1)
    return {
        "vertices": len(mesh.vertices),
        "faces": len(mesh.faces),
        "watertight": is_watertight(mesh.faces),
        "islands": int(part_of_face(mesh.faces).max(initial=-1)) + 1,
        "edge_mm": 1000 * float(np.median(edges)),
    }


def _copy_metrics(mesh: Mesh, copy: Mesh, rng: np.random.Generator, samples: int) -> dict[str, float]:
    """Return size, watertightness and Hausdorff distance (over vertices and samples) of a decimated copy."""
    full, decimated = Surface(mesh.vertices, mesh.faces), Surface(copy.vertices, copy.faces)
    of_full = decimated.distance(np.concatenate([mesh.vertices, full.sample(samples, rng)[0]]))
    of_copy = full.distance(np.concatenate([copy.vertices, decimated.sample(samples, rng)[0]]))
    return {
        "copy_vertex_share": len(copy.vertices) / len(mesh.vertices),
        "copy_watertight": float(is_watertight(copy.faces)),
        "copy_hausdorff_mm": 1000 * float(max(of_full.max(), of_copy.max())),
    }
