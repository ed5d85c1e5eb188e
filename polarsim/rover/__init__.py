"""A rover on soft ground: soil, wheels, drive, cameras, figures."""
