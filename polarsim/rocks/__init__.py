"""Stage 3, from scans to rocks and ground: clouds, cuboids and meshes."""

from polarsim.public import lazy_exports

__all__, __getattr__, __dir__ = lazy_exports(
    __name__,
    RocksOptions="options",
    find_rocks="find",
    mesh_rocks="mesh",
)
