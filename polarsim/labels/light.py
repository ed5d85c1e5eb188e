"""Brightness of photos that nobody took: light layers of the meshes, exposed as NASA's best exposures were."""

from __future__ import annotations

from functools import cached_property, lru_cache

import numpy as np

from polarsim.formats.scene import TerrainMesh
from polarsim.labels.known import Known
from polarsim.labels.photos import Brightness, PhotoSet
from polarsim.photo import Camera
from polarsim.render.gain import default_gain
from polarsim.render.lamps import lamps_of, lit_by
from polarsim.render.layers import render_view
from polarsim.render.options import Model, RenderOptions
from polarsim.render.surfaces import Surfaces, surfaces_of

MODEL: Model = "principled"
STEP_PX = 2  # layers have every second pixel along rows and columns: contrast is that of whole boxes
KEPT = 2  # views in memory: 3 MB for each of their lamps


class LightLayers:
    """What `Photos` tells, without photos: from meshes, stand-ins and lamps. A view is rendered once for all lamps."""

    def __init__(self, known: Known) -> None:
        self.known, self.options = known, RenderOptions()
        self._gain = default_gain(MODEL, self.options)
        self._layers = lru_cache(maxsize=KEPT)(self._render)

    def brightness(self, photo_set: PhotoSet) -> Brightness:
        """Sum of the layers of the lamps that are on; black in the dark. No photo was taken: no exposures."""
        position, camera, light, azimuth = photo_set
        layers = self._layers(position, camera)
        dark = np.zeros_like(next(iter(layers.values())))
        rate = self._gain * sum((layers[name] for name in lit_by(light, azimuth)), dark)
        return Brightness(rate.repeat(STEP_PX, axis=0).repeat(STEP_PX, axis=1), ())

    def _render(self, position: str, camera: Camera) -> dict[str, np.ndarray]:
        placed = self.known.placed[position]
        lens = placed.rig.lens(camera).scaled(1 / STEP_PX)
        lamps = lamps_of(self.known.world.suns, placed)
        view = render_view(self._surfaces, placed.sandbox_from(camera), lens, lamps, [MODEL], None, self.options)
        return {name: layer for (_, name), layer in view.layers.items()}

    @cached_property
    def _surfaces(self) -> Surfaces:
        return surfaces_of(_with_stand_ins(self.known), self.options)


def _with_stand_ins(known: Known) -> TerrainMesh:
    """The terrain's meshes and the domes of rocks that have none."""
    mesh = known.terrain
    vertices, faces, rocks, normals = [mesh.vertices], [mesh.faces], [mesh.rock_of_face], [mesh.normals]
    count = len(mesh.vertices)
    for rock, dome in sorted(known.domes.items()):
        own, corners = dome.mesh()
        upright = (own - dome.foot) / np.array([dome.radius, dome.radius, dome.height]) ** 2
        vertices.append(own)
        faces.append(corners + count)
        rocks.append(np.full(len(corners), rock))
        normals.append(upright / np.linalg.norm(upright, axis=1, keepdims=True))
        count += len(own)
    return TerrainMesh(*(np.concatenate(parts) for parts in (vertices, faces, rocks, normals)))
