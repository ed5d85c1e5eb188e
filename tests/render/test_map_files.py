"""Map files of twins."""

import numpy as np
import pytest
import tifffile
from pydantic import ValidationError

from polarsim.formats import png
from polarsim.photo import PhotoKey
from polarsim.render.options import RenderOptions
from polarsim.render.scene import Scene
from polarsim.render.shadows import FACES_AWAY, LIT
from polarsim.render.sidecar import read_sidecar
from polarsim.run_files.instances import SHADOW_IDS

from .conftest import render_into

KEYS = [PhotoKey.parse(f"01_A_{name}") for name in ("off_30_L_0256", "on_30_L_0064", "on_30_L_0256", "off_no_L_0512")]
SETS = ["01_A_off_30_L.png", "01_A_on_30_L.png"]


def make(folders, names, keys=KEYS, threads=1):
    options = RenderOptions(walls=False, maps=names)
    render_into(folders, {"hapke": folders / "twins"}, keys, options, threads=threads)
    return folders / "labels" / "maps"


def files_of(maps):
    return {folder.name: sorted(path.name for path in folder.iterdir()) for folder in maps.iterdir()}


def test_only_selected_maps_are_written(folders):
    assert not make(folders, ()).exists()
    assert files_of(make(folders, ("depth",))) == {"depth": ["01_A_L.png"]}
    with pytest.raises(ValidationError):
        RenderOptions(maps=("albedo",))


def test_maps_without_light_are_per_view_and_others_per_bracket(folders):
    maps = make(folders, ("depth", "depth_float", "normal", "angles", "shading", "lit"))
    of_views = {name: ["01_A_L.png"] for name in ("depth", "normal", "emergence")} | {"depth_float": ["01_A_L.tif"]}
    of_sets = dict.fromkeys(("incidence", "phase", "shading", "lit"), SETS)
    assert files_of(maps) == of_views | of_sets


def test_map_files_equal_the_maps_of_the_scene_in_the_sidecar(folders):
    maps = make(folders, ("depth", "depth_float", "normal", "angles", "shading", "lit"))
    sidecar = read_sidecar(folders / "twins" / f"{KEYS[2]}.json")
    expected = Scene(folders / "meshes", 1, sidecar.options).maps(sidecar.shot)
    sun, seen = expected.by_lamp["30"], expected.ids > 0
    of_set = {name: png.read_png(maps / name / SETS[1]) for name in ("incidence", "phase", "lit")}
    depth = tifffile.imread(maps / "depth_float" / "01_A_L.tif")
    assert depth.dtype == np.float32
    np.testing.assert_allclose(depth, expected.depth_m, rtol=1e-6)
    np.testing.assert_allclose(png.read_png(maps / "depth" / "01_A_L.png")[seen] / 1000, depth[seen], atol=5.1e-4)
    np.testing.assert_allclose(of_set["incidence"][seen] / 100, sun.incidence_deg[seen], atol=6e-3)
    np.testing.assert_allclose(of_set["phase"][seen] / 100, sun.phase_deg[seen], atol=6e-3)
    assert all((picture[~seen] == 65535).all() for picture in of_set.values())
    shading = png.read_png(maps / "shading" / SETS[1])
    assert (shading != sun.shading).mean() < 1e-3  # the stored pose was orthogonalised
    np.testing.assert_array_equal(of_set["lit"][seen] == 10_000, shading[seen] == LIT)
    ids = png.read_png(folders / "labels" / "instances" / SETS[1])
    np.testing.assert_array_equal((ids >= SHADOW_IDS) & (shading != FACES_AWAY), (ids >= SHADOW_IDS) & (shading == ids))


def test_the_same_bytes_with_one_thread_and_two(folders):
    names = ("normal", "angles", "shading", "lit", "depth_float")
    first = {path: path.read_bytes() for path in make(folders, names).rglob("*.*")}
    assert len(first) == 11
    assert first == {path: path.read_bytes() for path in make(folders, names, threads=2).rglob("*.*")}
