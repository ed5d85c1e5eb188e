"""One file an outside format, its reader beside its writer."""

from polarsim.public import offered

__all__, __getattr__, __dir__ = offered(
    __name__,
    LocalisedRig="rigs",
    read_localised="rigs",
    write_localised="rigs",
    to_8bit="tone",
    read_terrain="scene",
    read_parquet="tables",
    pictures_of="run_files",
)
