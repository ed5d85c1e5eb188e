"""A rover on soft ground, room by room: what bears it, what it is, how it drives, what it sees and makes of it."""
