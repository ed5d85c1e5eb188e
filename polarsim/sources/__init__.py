"""Data sources of raw data.

- `source`: the protocol that each source implements
- `files`: photos and scans in the layout of a site (`source.kind: files`)
- `analog`: the simulated sandbox, in the layout of its site
- `release`: the published labels and meshes
- `registry`: the sources by the value of `source.kind`

To add a source, add a module with a class that implements the protocol, and an entry in `registry`.
"""
