import json

import pytest

from polarsim.errors import FormatError
from polarsim.photo import PhotoKey
from polarsim.run_files.fitted_photos import FittedPhotos, read_fitted_photos
from polarsim.run_files.materials import TABLE_FILE

LAMPS = {"30": 1.5, "180": 2.0, "rover": 12.25}
FIT = {"parameters": {}, "lamps": LAMPS, "rocks": {}, "check": {}}


def photos_of(folder, **content):
    (folder / TABLE_FILE).write_text(json.dumps({"falloff": False} | content))
    return read_fitted_photos(folder)


def test_photos_of_a_fit_are_those_of_the_recorded_suns_and_positions(tmp_path):
    fitted = photos_of(tmp_path, azimuths=["180"], positions=["A"], models={"hapke": FIT})
    assert fitted == FittedPhotos(frozenset({"180"}), frozenset({"A"}))
    names = ["03_A_on_180_R_1024", "03_C_off_180_L_0256", "03_A_off_30_L_0256"]
    assert [fitted.includes(PhotoKey.parse(name)) for name in names] == [True, False, False]


def test_without_a_record_the_lamps_of_all_models_are_fitted_at_every_position(tmp_path):
    assert photos_of(tmp_path, models={"hapke": FIT}) == FittedPhotos(frozenset(LAMPS))


def test_a_failed_fit_has_no_photos(tmp_path):
    assert photos_of(tmp_path, models={}) is None


def test_a_file_without_models_is_an_error(tmp_path):
    with pytest.raises(FormatError, match=TABLE_FILE):
        photos_of(tmp_path, azimuths=["30"])
