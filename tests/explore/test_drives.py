import numpy as np
import pytest

from polarsim.explore.drives import drive_content, drive_pictures
from polarsim.formats import png
from polarsim.formats.npz import write_arrays
from polarsim.formats.tables import read_parquet
from polarsim.rover.drive.trace import write_trace
from tests.rover.driven import trace


def test_a_drive_has_the_true_length_and_all_frames(made):
    folder = made / "rover/seed0"
    told = drive_content(folder)
    places = read_parquet(folder / "trace.parquet")[["x_m", "y_m"]].to_numpy()
    assert told["length_m"] == pytest.approx(np.hypot(*np.diff(places, axis=0).T).sum(), abs=1e-3)
    path = np.array(told["path"]).reshape(-1, 2)
    np.testing.assert_allclose(path[[0, -1]], places[[0, -1]], atol=0.021)
    (view,) = told["views"]
    assert view["looks"] == {"1_hapke_0064": [0, 1, 2]}
    assert view["frames"] == [0, 1, 2, 3]
    np.testing.assert_allclose(view["rover"][:4], [0.5, 0, 1.5, 0.5 * np.sin(1.25)], atol=1e-4)  # after 0 and 5 s
    assert told["rocks"][1] == {"rock": "3.2", "x_m": 4.0, "y_m": 1.0, "radius_m": 0.06}


def test_files_of_the_rover_are_read(tmp_path):
    write_trace(tmp_path, trace())
    told = drive_content(tmp_path)
    assert told["length_m"] == pytest.approx(0.2 * 6, abs=0.01)
    assert len(told["rocks"]) == 5
    assert told["views"] == []
    assert set(drive_pictures(tmp_path)) == {"map.jpg"}


def test_on_the_map_north_is_up_and_slopes_to_the_north_west_are_bright(tmp_path):
    x, y = np.meshgrid(np.linspace(0, 4, 81), np.linspace(0, 2, 41))
    hill = 0.4 * np.exp(-((x - 3) ** 2 + (y - 1.4) ** 2) / 0.1)  # in the north-east
    write_arrays(
        tmp_path / "world/ground.npz", x0_m=np.float64(0), y0_m=np.float64(0), cell_m=np.float64(0.05), level_m=hill
    )
    (tmp_path / "map.jpg").write_bytes(drive_pictures(tmp_path)["map.jpg"]())
    shade = png.read_png(tmp_path / "map.jpg").astype(float)
    assert shade.shape == (41, 81)
    row, column = 40 - 28, 60  # its top
    assert shade[row - 4, column - 4] > shade[row + 4, column + 4] + 60
