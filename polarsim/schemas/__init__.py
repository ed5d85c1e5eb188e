"""Columns of all tables that a run writes: name, type, unit and description, each declared once.

Writers order their columns by a `Table`, readers check a file against it, and `make columns` writes the
tables of columns in `docs/tables.md` and `docs/formats.md`. Each group of stages has a module, so that a new column
re-runs only the jobs that import the module: `photos` (photos and labels), `stages` (cameras and rocks), `detect`,
`covers`, `evaluation`, `rover` and `report` (the tables below `tables/`).
"""
