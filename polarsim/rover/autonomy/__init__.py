"""A rover that decides: what it sees becomes a map of hazards, the map a path, the path what the wheels do."""
