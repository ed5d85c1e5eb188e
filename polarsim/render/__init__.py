"""Stage 5: render twins of every photo from meshes and cameras, with exact labels.

Steps, in the order in which a pixel is computed:

1. surfaces: triangles with ids of the meshes of a terrain, their skirts and the walls; `lamps` places the lamps.
2. hits (`hit_kernels`): rays through the distorted lens to the nearest surface, with smooth normals.
3. lighting: visibility and irradiance of each lamp; `shadows`: occluder of each shadowed pixel.
4. materials: reflectance of each object, evaluated by `brdf` (reference), `brdf_numba` or `brdf_taichi`.
5. olat: one-light-at-a-time images and id maps of a view (`device_olat` on a GPU), plus the light of `indirect`, which
   `upsampling` interpolates from a coarse grid to all pixels.
6. optics: blur, glare and vignetting of the lens.
7. gain and sensor: radiance times gain and exposure to 12 bits with noise (`expose`).
8. ground_truth, maps: labels and maps from the same hits.
9. twins, twin_writer, sidecar: the files of a terrain. `scene` renders single images, `views` novel viewpoints.

`fitting` estimates light and materials from photos before rendering; `goniometer` tabulates the models.
"""

from polarsim.public import lazy_exports

__all__, __getattr__, __dir__ = lazy_exports(
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
