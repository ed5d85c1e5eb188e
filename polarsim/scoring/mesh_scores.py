"""Each mesh by itself: is it sound, does it meet the ground, is its thinned copy near, is it where the rock was."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pandas as pd

from polarsim.formats import obj
from polarsim.geometry.meshes import Mesh
from polarsim.geometry.topology import is_watertight, part_of_face
from polarsim.photo import NO_ROCK
from polarsim.run_files.scene import TerrainMesh, made_from
from polarsim.schemas.evaluation import MESH_SCORES
from polarsim.scoring.surface import Surface
from polarsim.scoring.true_surface import Samples

COLUMNS = MESH_SCORES.dtypes
SECTORS = 72  # about a rock, in each of which it must reach the ground
CONTACT = 0.002  # metres: a wider gap between a rock and its ground shows
F_DISTANCE = 0.005  # metres within which two surfaces are the same


def mesh_table(rows: list[dict[str, object]]) -> pd.DataFrame:
    """Rows with `COLUMNS`; what was not measured is NaN."""
    table = pd.DataFrame(rows, columns=list(COLUMNS))
    return table.astype(COLUMNS).round({name: 6 for name, kind in COLUMNS.items() if kind == "float64"})


def soundness_rows(
    scene: TerrainMesh, folder: Path, terrain: int, rng: np.random.Generator, samples: int
) -> list[dict[str, object]]:
    """A row for the ground and for every rock of a scene, by the order of ids; thinned copies lie in the folder."""
    ground = scene.part(NO_ROCK)
    level = Surface(ground.vertices, ground.faces)
    sources = made_from(folder)
    rows = [_named(obj.ground_name(terrain), NO_ROCK, ground, sources)]
    for rock, path in obj.rock_files(folder).items():
        mesh = scene.part(rock)
        row = {**_named(path.name, rock, mesh, sources), "contact_share": contact_share(mesh, level)}
        copy = path.with_name(obj.rock_name(terrain, rock, decimated=True))
        if copy.exists() and copy != path:
            row |= _copy_metrics(mesh, obj.read(copy), rng, samples)
        rows.append(row)
    return rows


def accuracy(there: Samples, back: Samples, true_of_found: Mapping[int, int]) -> dict[int, dict[str, float]]:
    """Metrics by found rock, the ground's under `NO_ROCK`.

    Parameters
    ----------
    there, back : Samples
        Of the true surface and of ours.
    true_of_found
        True rock by found rock.
    """
    metrics = {}
    for found, true in {NO_ROCK: NO_ROCK, **true_of_found}.items():
        wanted, given = there.rock == true, back.rock == found
        if wanted.any():
            far = there.distance[wanted]
            metrics[found] = {
                "true_rock": float(true),
                "surface_median_mm": 1000 * float(np.median(far)),
                "surface_p90_mm": 1000 * float(np.percentile(far, 90)),
                "f_score_5mm": f_score(far, back.distance[given]),
                "surface_iou": surface_iou(there, back, true, found),
            }
    return metrics


def surface_iou(there: Samples, back: Samples, true: int, found: int) -> float:
    """Seen surface that is both the true rock's and our rock's, over what is one of the two, by area."""
    wanted = there.rock == true
    both = there.area[wanted & (there.beside == found)].sum()
    ours_alone = back.area[(back.rock == found) & (back.beside != true)].sum()
    return float(both / (there.area[wanted].sum() + ours_alone))


def f_score(there: np.ndarray, back: np.ndarray) -> float:
    """Harmonic mean of the shares of points (n,), (m,) of two surfaces that lie within 5 mm of the other one.

    Knapitsch et al., ACM ToG 36:78 (2017).
    """
    if not len(there) or not len(back):
        return float("nan")
    recall, precision = (there < F_DISTANCE).mean(), (back < F_DISTANCE).mean()
    return float(2 * recall * precision / (recall + precision)) if recall + precision else 0.0


def contact_share(rock: Mesh, ground: Surface) -> float:
    """Share of the directions about a rock in which its mesh comes to within 2 mm of the ground, or below it."""
    above = ground.height_below(rock.vertices)
    offset = rock.vertices[:, :2] - (rock.vertices[:, :2].min(axis=0) + rock.vertices[:, :2].max(axis=0)) / 2
    azimuth = np.arctan2(offset[:, 1], offset[:, 0])
    sector = np.minimum(((azimuth + np.pi) / (2 * np.pi) * SECTORS).astype(int), SECTORS - 1)
    lowest = np.full(SECTORS, np.inf)
    np.fmin.at(lowest, sector, above)  # NaN beside the ground
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
    """Size, closedness and Hausdorff distance of a thinned copy, from all vertices and points on both surfaces."""
    full, thin = Surface(mesh.vertices, mesh.faces), Surface(copy.vertices, copy.faces)
    there = thin.distance(np.concatenate([mesh.vertices, full.sample(samples, rng)[0]]))
    back = full.distance(np.concatenate([copy.vertices, thin.sample(samples, rng)[0]]))
    return {
        "copy_vertex_share": len(copy.vertices) / len(mesh.vertices),
        "copy_watertight": float(is_watertight(copy.faces)),
        "copy_hausdorff_mm": 1000 * float(max(there.max(), back.max())),
    }
