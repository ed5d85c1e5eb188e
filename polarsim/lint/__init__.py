"""A linter for labelled photos: defects that siblings, geometry and light show without looking at a picture."""
