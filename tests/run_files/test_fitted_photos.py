"""Photos that took part in fits: materials, light fields and the ground."""

import json

import pytest

from polarsim.errors import FormatError
from polarsim.geometry.light_field import EVEN
from polarsim.photo import PhotoKey
from polarsim.run_files.fitted_photos import GROUND_FILE, FittedPhotos, read_fits
from polarsim.run_files.light_fields import FittedField, write_light_fields
from polarsim.run_files.materials import TABLE_FILE

FIT = {"parameters": {}, "lamps": {"180": 2.0, "rover": 12.25}, "rocks": {}, "check": {}}
KEYS = [PhotoKey.parse(name) for name in ("03_A_on_180_R_1024", "03_C_off_180_L_0256", "03_A_off_30_L_0256")]


def materials(folder, models=("fitted",)):
    content = {"azimuths": ["180"], "positions": ["A"], "models": dict.fromkeys(models, FIT)}
    (folder / TABLE_FILE).write_text(json.dumps(content))
    return folder


def test_photos_of_fitted_materials_are_those_of_the_recorded_suns_and_positions(tmp_path):
    fits = read_fits(("principled", "fitted"), materials(tmp_path), None, tmp_path)
    assert fits == {"principled": [], "fitted": [FittedPhotos(frozenset({"180"}), frozenset({"A"}))]}
    assert [fits["fitted"][0].includes(key) for key in KEYS] == [True, False, False]


def test_a_light_field_is_fitted_to_the_photos_of_its_terrains_and_positions_only(tmp_path):
    path = tmp_path / "light.json"
    fields = {
        "180": FittedField(coefficients=EVEN, terrains=(3, 11), positions=("A",)),
        "30": FittedField(coefficients=EVEN, terrains=(11,), positions=()),
    }
    write_light_fields(path, {"fitted": fields})
    fits = read_fits((), None, path, tmp_path)
    assert [any(fit.includes(key) for fit in fits["fitted"]) for key in KEYS] == [True, False, False]


@pytest.mark.parametrize("refined", [True, False])
def test_a_ground_refined_by_photos_is_part_of_the_twins_of_all_domains(tmp_path, refined):
    record = {"refined": refined, "photos": [str(KEYS[1])], "cell_mm": 5.0}
    (tmp_path / GROUND_FILE).write_text(json.dumps(record))
    fits = read_fits(("principled", "hapke"), None, None, tmp_path)
    for domain in ("principled", "hapke"):
        assert [any(fit.includes(key) for fit in fits[domain]) for key in KEYS] == [False, refined, False]


def test_failed_fits_have_no_photos(tmp_path):
    assert read_fits(("fitted",), materials(tmp_path, models=()), None, tmp_path) == {"fitted": []}


@pytest.mark.parametrize("content", [{"azimuths": ["30"]}, {"models": {}, "positions": []}, []])
def test_an_incomplete_record_is_an_error(tmp_path, content):
    (tmp_path / TABLE_FILE).write_text(json.dumps(content))
    with pytest.raises(FormatError, match=TABLE_FILE):
        read_fits(("fitted",), tmp_path, None, tmp_path)
