"""Sidecar files of images."""

import hashlib
import json
import shutil
import subprocess
from dataclasses import replace

import numpy as np
import pytest

from polarsim.errors import FormatError
from polarsim.formats import obj, png
from polarsim.photo import PhotoKey
from polarsim.randomness import generator
from polarsim.render.lamps import ROVER
from polarsim.render.options import RenderOptions
from polarsim.render.scene import Scene
from polarsim.render.sidecar import digest_of, read_sidecar, write_sidecar
from polarsim.run_files.instances import ROCK_IDS
from polarsim.run_files.walls import FILE, level_walls, write_walls

from .conftest import render_into

KEYS = [PhotoKey.parse(f"01_A_{name}_0256") for name in ("off_30_L", "on_30_L", "on_180_R", "off_no_L")]
OPTIONS = RenderOptions(
    walls=False, materials={"default": {"hapke": "sato_mare_643"}}, lamp_radius_m=0.05, gain={"hapke": 40.0}
)


def make(folders, out="twins", options=OPTIONS):
    render_into(folders, {"hapke": folders / out}, KEYS, options)
    return folders / out


def test_a_twin_can_be_rendered_again_from_sidecar_and_meshes(folders):
    twins = make(folders)
    names = [f"{key}{suffix}" for key in KEYS for suffix in (".json", ".png")]
    assert sorted(path.name for path in twins.iterdir()) == sorted(names)
    lamps = []
    for key in KEYS:
        sidecar = read_sidecar(twins / f"{key}.json")
        again = Scene(folders / "meshes", sidecar.terrain, sidecar.options).picture(sidecar.shot)
        assert (again != png.read_png(twins / f"{key}.png")).mean() < 1e-3  # the stored pose is orthogonalised
        assert (again > 16).any() == (key != KEYS[3])
        lamps.append(list(sidecar.shot.lamps))
    assert lamps == [["30"], ["30", ROVER], ["180", ROVER], []]  # the first casts the labelled shadows


def test_a_twin_with_walls_fitted_to_photos_can_be_rendered_again_from_its_run(folders, tmp_path):
    run, options = tmp_path / "run", OPTIONS.model_copy(update={"walls": True})
    meshes, cameras = run / "meshes" / "Terrain01", run / "cameras" / "Terrain01"
    shutil.copytree(folders / "meshes", meshes)
    write_walls(folders / "meshes", level_walls(1.9, 0.2, "scans"))
    write_walls(folders / "cameras", level_walls(1.0, 0.5, "photos"))  # near enough to shade the block
    sidecar = read_sidecar((twins := make(folders, options=options)) / f"{KEYS[0]}.json")
    twin = png.read_png(twins / f"{KEYS[0]}.png")
    measured = Scene(folders / "meshes", 1, sidecar.options)  # outside a run
    assert (measured.picture(sidecar.shot) != twin).mean() > 0.1
    shutil.copytree(folders / "cameras", cameras)
    of_run = Scene(meshes, sidecar.terrain, sidecar.options)
    assert (of_run.picture(sidecar.shot) != twin).mean() < 1e-3
    assert digest_of([cameras / FILE]) == sidecar.sources["walls"]
    assert of_run.digests[FILE] == hashlib.sha256((cameras / FILE).read_bytes()).hexdigest()


def test_the_light_field_of_a_lamp_is_stored(folders, tmp_path):
    sidecar = read_sidecar(make(folders) / f"{KEYS[0]}.json")
    assert "light_field" not in sidecar.content()["lamps"]["30"]
    field = tuple(0.1 * number for number in range(9))
    lamps = {"30": replace(sidecar.shot.lamps["30"], light_field=field)}
    write_sidecar(tmp_path / "a.json", replace(sidecar, shot=replace(sidecar.shot, lamps=lamps)).content())
    assert read_sidecar(tmp_path / "a.json").shot.lamps["30"].light_field == field


def test_the_noise_seed_reproduces_the_noise(folders):
    twins = make(folders, options=OPTIONS.model_copy(update={"noise": True}))
    for key in KEYS[:2]:
        sidecar = read_sidecar(twins / f"{key}.json")
        options = sidecar.options.model_copy(update={"noise": False})
        quiet = Scene(folders / "meshes", 1, options).picture(sidecar.shot)
        draw = generator(*sidecar.noise_seed).standard_normal(quiet.shape, np.float32)
        noise = png.read_png(twins / f"{key}.png").astype(float) - quiet
        free = (quiet > 100) & (quiet < 3500)
        assert (
            np.corrcoef(noise[free], draw[free])[0, 1] > 0.95
        )  # below 1 because of rounding and signal-dependent noise


def test_mesh_points_can_be_projected_with_the_sidecar(folders):
    twins = make(folders)
    rock = obj.read_obj(folders / "meshes" / obj.rock_name(1, 1))
    top = rock.vertices[rock.vertices[:, 2] > rock.vertices[:, 2].max() - 1e-6]
    inside = 0.9 * top + 0.1 * top.mean(axis=0)
    for key in KEYS:
        shot = read_sidecar(twins / f"{key}.json").shot
        pixels = shot.camera.project(inside)
        column, row = np.floor(pixels).astype(int).T
        ids = png.read_png(folders / "labels" / "instances" / f"{str(key).rpartition('_')[0]}.png")
        assert (ids[row, column] == ROCK_IDS + 1).all()


def test_the_same_run_in_another_folder_gives_the_same_bytes(folders, tmp_path_factory):
    elsewhere = tmp_path_factory.mktemp("elsewhere") / "run"
    subprocess.run(["cp", "-r", str(folders), str(elsewhere)], check=True)
    first, second = make(folders), make(elsewhere)
    for path in first.glob("*.json"):
        assert path.read_bytes() == (second / path.name).read_bytes()
        assert str(folders) not in path.read_text()


def test_sources_change_with_meshes_and_lamps(folders):
    def sources():
        return read_sidecar(make(folders) / f"{KEYS[0]}.json").sources

    before = sources()
    assert set(before) == {"meshes", "camera"}
    (folders / "cameras" / "lamps.json").write_text('{"30": [3, 2, 0.8]}')
    assert set(sources()) == {"meshes", "camera", "lamps"}
    with (folders / "meshes" / obj.rock_name(1, 1)).open("a") as file:
        file.write("# edited\n")
    after = sources()
    assert after["meshes"] != before["meshes"]
    assert after["camera"] == before["camera"]


INVALID = [
    ("lens", {"fx_px": 3}),
    ("sandbox_from_camera", [[1, 0], [0, 1]]),
    ("lamps", {"30": {"position": [1, 2]}}),
    ("lamps", {"30": {"position": [1, 2, 3], "colour": "red"}}),
    ("lamps", {"30": {"position": [1, 2, 3], "light_field": [0.1, 0.2]}}),
    ("lamps", []),
    ("model", "phong"),
    ("parameters", {"w": 3}),
    ("options", {"rimm": True}),
    ("gain_per_ms", None),
    ("gain_per_ms", -1),
    ("exposure_ms", "long"),
    ("sources", 7),
    ("noise_seed", 1),
]


def test_an_invalid_sidecar_is_reported_in_one_line(folders):
    content = json.loads((make(folders) / f"{KEYS[0]}.json").read_text())
    path = folders / "invalid.json"
    for name, value in INVALID:
        for changed in (content | {name: value}, {key: other for key, other in content.items() if key != name}):
            write_sidecar(path, changed)
            with pytest.raises(FormatError) as error:
                read_sidecar(path)
            assert error.value.path == path, name
            assert "\n" not in str(error.value)


def test_a_scene_s_sidecar_reads_back(folders, lens, camera):
    scene = Scene(folders / "meshes", 1, OPTIONS)
    made = make(folders)
    shot = read_sidecar(made / f"{KEYS[1]}.json").shot
    write_sidecar(folders / "shot.json", scene.sidecar(replace(shot, exposure_ms=12.5)))
    sidecar = read_sidecar(folders / "shot.json")
    assert sidecar.shot.exposure_ms == 12.5
    assert sidecar.shot.camera.lens == lens
    assert sidecar.options.parameters("hapke") == OPTIONS.parameters("hapke")
    assert sidecar.gain_per_ms == 40
    np.testing.assert_allclose(sidecar.shot.camera.world_from_camera.matrix, camera.matrix, atol=1e-12)
    assert set(sidecar.sources) == {obj.ground_name(1), obj.rock_name(1, 1)}
