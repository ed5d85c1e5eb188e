"""Binary glTF 2.0 of a terrain, for viewers: ground and rocks as named nodes, metres, +Y up as glTF requires.

Vertices without support from a scan are tinted. The support, 0 to 1, is the vertex attribute `_SUPPORT`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from polarsim.formats.files import writing
from polarsim.geometry.meshes import Mesh
from polarsim.photo import Terrain, terrain_text

GROUND_NODE = "ground"  # name of the ground node; the other nodes are rocks
SAND_COLOUR, ROCK_COLOUR, UNSEEN = np.array([176, 168, 152]), np.array([110, 106, 100]), np.array([168, 92, 72])  # sRGB
Y_UP_FROM_SANDBOX = np.array([[1.0, 0, 0, 0], [0, 0, 1, 0], [0, -1, 0, 0], [0, 0, 0, 1]])


def name(terrain: Terrain) -> str:
    return f"terrain{terrain_text(terrain)}.glb"


def write_glb(
    path: str | Path,
    parts: Mapping[str, Mesh],
    support: Mapping[str, np.ndarray],
    extras: Mapping[str, Mapping[str, Any]] | None = None,
    finish: Callable[[dict[str, Any]], None] | None = None,
) -> None:
    """Write meshes by node name, with the support (v,) of the vertices if it is known, and metadata `extras`.

    `finish` edits the JSON of the file before it is written, to add nodes that are not meshes.
    """
    import trimesh

    scene = trimesh.Scene(base_frame="sandbox")
    for node, mesh in parts.items():
        known = support.get(node, np.ones(len(mesh.vertices)))[:, None]
        colour = known * (SAND_COLOUR if node == GROUND_NODE else ROCK_COLOUR) + (1 - known) * UNSEEN
        body = trimesh.Trimesh(
            mesh.vertices.astype(np.float32),
            mesh.faces,
            process=False,
            vertex_normals=mesh.normals(),
            vertex_colors=np.hstack([np.round(colour), np.full_like(known, 255)]).astype(np.uint8),
            vertex_attributes={"_SUPPORT": known.astype(np.float32)},
            metadata=dict((extras or {}).get(node, {})),
        )
        scene.add_geometry(body, node_name=node, geom_name=node, transform=Y_UP_FROM_SANDBOX)
    with writing(path) as temporary:
        temporary.write_bytes(scene.export(file_type="glb", include_normals=True, tree_postprocessor=finish))
