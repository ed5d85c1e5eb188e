"""Selection of samples: next to walls, of other scenes, of single lamps."""

from dataclasses import replace

import numpy as np
import pytest

from polarsim.render.fitting.fit import fit
from polarsim.render.fitting.samples import clear_of_walls
from polarsim.render.fitting.terrain import lamps_in, samples_of_scene
from polarsim.render.lamps import ROVER
from polarsim.render.options import FittingOptions
from polarsim.run_files.walls import Walls, level_walls
from tests.render.fitting.conftest import LAMPS


@pytest.mark.parametrize(("nominal", "used"), [(False, [False, True, True]), (True, [False, False, True])])
def test_sand_next_to_a_wall_that_no_scan_shows_is_not_used(nominal, used):
    sides = {side: replace(wall, support=0.9) for side, wall in level_walls(2.0, 0.3).sides.items()}
    sides |= {"+x": replace(sides["+x"], support=0.0)} if nominal else {}
    points = np.array([[1.98, 0.0, 0.0], [1.90, 0.0, 0.0], [1.80, 0.0, 0.0]])
    found = clear_of_walls(points, np.array([0.0, 0.0, 3.0]), Walls(sides, "scans"))
    assert found.tolist() == used


def scattered(studio, lamps, rng):
    """Return the samples of a studio in which photos under some lamps show another scene."""
    foreign = np.isin(studio.samples.lamp, [LAMPS.index(name) for name in lamps])
    factor = np.where(foreign, rng.lognormal(0, 2, len(foreign)), 1).astype(np.float32)
    return replace(studio.samples, rate=studio.samples.rate * factor)


def test_photos_of_another_scene_are_not_fitted(studio, rng, caplog):
    own = samples_of_scene(1, studio.samples, LAMPS)
    assert (len(own), caplog.records) == (len(studio.samples), [])
    suns = [name for name in lamps_in(studio.samples, LAMPS) if name != ROVER]
    assert len(suns) > 2
    one_foreign = samples_of_scene(1, scattered(studio, suns[:1], rng), LAMPS)
    assert lamps_in(one_foreign, LAMPS) == tuple(name for name in lamps_in(studio.samples, LAMPS) if name != suns[0])
    assert len(samples_of_scene(1, scattered(studio, suns, rng), LAMPS)) == 0
    assert [record.levelname for record in caplog.records] == ["WARNING"] * 2


def test_photos_of_a_single_lamp_keep_the_parameters_of_the_options(studio, engine, caplog):
    single = studio.samples.part(studio.samples.lamp == studio.samples.lamp[0])
    options = studio.options.model_copy(update={"fitting": FittingOptions(parameters={"lambert": ("albedo",)})})
    options = options.model_copy(update={"fitting": options.fitting.model_copy(update={"held_out": "no"})})
    found = fit(single, LAMPS, studio.mesh, ["lambert"], engine, options)
    assert found.models["lambert"].parameters == options.parameters("lambert").model_dump()
    assert sum("single lamp" in record.message for record in caplog.records) == 1
