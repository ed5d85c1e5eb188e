"""Stage 5: from meshes and cameras to twins of every photo, with exact labels.

A pixel passes these steps:

1. surfaces: the meshes of a terrain, their skirts and the walls as triangles with ids; `lamps` places the lamps.
2. hits (`hit_kernels`): rays through the distorted lens to the nearest surface, with smooth normals.
3. lighting: visibility and irradiance of each lamp; `shadows`: the thing that hides it.
4. materials: reflectance by thing, evaluated by `brdf` (reference), `brdf_numba` or `brdf_taichi`.
5. olat: one-light-at-a-time images and id maps of a view (`device_olat` on a GPU), with the light of `indirect`, which
   `upsampling` brings from a coarse grid to all pixels.
6. optics: blur, glare and vignetting of the lens.
7. gain and sensor: radiance times gain and exposure to 12 bits with noise (`expose`).
8. ground_truth, maps: labels and maps from the same hits.
9. twins, twin_writer, sidecar: the files of a terrain. `scene` makes single pictures, `views` novel viewpoints.

`fitting` estimates materials from photos before all of this; `goniometer` tabulates the models.
"""

from polarsim.public import offered

__all__, __getattr__, __dir__ = offered(
    __name__,
    Scene="scene",
    Shot="sidecar",
    Lamp="lamps",
    RenderOptions="options",
    Maps="maps",
    read_sidecar="sidecar",
    Views="views.options",
    read_views="views.options",
    render_views="views.run",
)
