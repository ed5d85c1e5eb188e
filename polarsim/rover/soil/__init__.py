"""Ground that gives way under wheels: its law, contact and displaced soil by two engines, checks without a rover."""
