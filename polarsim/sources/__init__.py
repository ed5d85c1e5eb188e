"""Data sources: where the raw data of a run come from.

- `source`: the protocol that each source implements
- `nasa`: NASA's photos and scans (`source.kind: polar`)
- `analog`: the simulated sandbox, in NASA's layout
- `release`: the published labels and meshes
- `registry`: the sources by the name that `source.kind` gives them

A further source is one module with a class that implements the protocol, and its name in `registry`.
"""
