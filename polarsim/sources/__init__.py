"""Data sources of raw data.

- `source`: the protocol that each source implements
- `nasa`: NASA's photos and scans (`source.kind: polar`)
- `analog`: the simulated sandbox, in NASA's layout
- `release`: the published labels and meshes
- `registry`: the sources by the value of `source.kind`

To add a source, add a module with a class that implements the protocol, and an entry in `registry`.
"""
