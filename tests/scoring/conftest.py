from tests.made_terrain import cube, sand, sun_lamps, world  # noqa: F401  fixtures
