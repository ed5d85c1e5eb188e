"""The soil as a drive steps it, without a rover: contact every step, displaced soil moved every few."""

from __future__ import annotations

from polarsim.rover.soil import bulldozing_numba, contact_numba
from polarsim.rover.soil.bulldozing import Bulldozing
from polarsim.rover.soil.contact import Rule, Wrenches
from polarsim.rover.soil.law import Law
from polarsim.rover.soil.nodes import Ground
from polarsim.rover.soil.shapes import Bodies, reach


class SoilBed:
    """Ground and the law by which it gives way; `steps` counts the steps so far."""

    def __init__(self, ground: Ground, law: Law, bulldozing_rule: Bulldozing | None = None) -> None:
        self.ground, self.law, self.bulldozing, self.steps = ground, law, bulldozing_rule, 0

    def step(self, bodies: Bodies, dt: float) -> Wrenches:
        """Forces on the bodies where they are now; the ground gives way."""
        self.ground.require_inside(bodies.centres, reach(bodies.numbers))
        wrenches = contact_numba.press(self.ground, bodies, self.law, Rule(), dt)
        self.steps += 1
        if self.bulldozing is not None and self.steps % self.bulldozing.every == 0:
            bulldozing_numba.bulldoze(self.ground, bodies, self.bulldozing)
        return wrenches
