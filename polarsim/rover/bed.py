"""The soil as a drive uses it: contact every step, displaced soil moved every few, by the engine that was asked for."""

from __future__ import annotations

from typing import Literal

from polarsim.errors import RoverError
from polarsim.rover import bulldozing, contact
from polarsim.rover.bulldozing import Bulldozing
from polarsim.rover.contact import Bodies, Rule, Wrenches
from polarsim.rover.ground import Ground
from polarsim.rover.shapes import reach
from polarsim.rover.soil import Law


class SoilBed:
    """Ground and the law by which it gives way.

    `steps` counts the steps so far; with `ground` it is all that a stopped drive has to keep.
    """

    def __init__(
        self,
        ground: Ground,
        law: Law,
        rule: Rule | None = None,
        bulldozing_rule: Bulldozing | None = None,
        engine: Literal["numba", "numpy"] = "numba",
        steps: int = 0,
    ) -> None:
        self.ground, self.law, self.rule, self.bulldozing = ground, law, rule or Rule(), bulldozing_rule
        self.steps = steps
        if engine == "numba":
            from polarsim.rover import bulldozing_numba, contact_numba

            self._press, self._bulldoze = contact_numba.press, bulldozing_numba.bulldoze
        elif engine == "numpy":
            self._press, self._bulldoze = contact.press, bulldozing.bulldoze
        else:
            raise RoverError(f"engine {engine!r}, numba or numpy was expected")

    def step(self, bodies: Bodies, dt: float) -> Wrenches:
        """Forces on the bodies where they are now; the ground gives way.

        Raises
        ------
        RoverError
            A body reaches beyond the ground.
        """
        self.ground.require_inside(bodies.centres, reach(bodies.numbers))
        wrenches = self._press(self.ground, bodies, self.law, self.rule, dt)
        self.steps += 1
        if self.bulldozing is not None and self.steps % self.bulldozing.every == 0:
            self._bulldoze(self.ground, bodies, self.bulldozing)
        return wrenches
