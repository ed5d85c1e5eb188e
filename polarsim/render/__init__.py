"""Stage 5, meshes and cameras to twins of every photo, with exact labels."""

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
