"""Pictures of the report, each from files to one PNG or two."""
