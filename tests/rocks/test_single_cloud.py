import numpy as np
import pandas as pd
import pytest
from scipy.spatial import ConvexHull

from polarsim.errors import FormatError, ReconstructionError
from polarsim.extras import ExtraError
from polarsim.formats import tables
from polarsim.formats.clouds import read_any_cloud
from polarsim.formats.ply import Cloud, write_ply
from polarsim.rocks.single_cloud import MIN_POINTS, find_rocks_in_cloud, stray_points, upright_points
from tests.rocks.conftest import SIZES


@pytest.fixture(scope="module")
def scanned(three_rock_scans):
    """Return points (n, 3) of both scans around the three rocks."""
    points = three_rock_scans.points[::3]
    return points[(points[:, 0] > -0.5) & (points[:, 0] < 1.4) & (points[:, 1] > -1.2) & (points[:, 1] < 0.9)]


@pytest.fixture(scope="module")
def found(scanned, tmp_path_factory):
    path = tmp_path_factory.mktemp("cloud") / "cloud.xyz"
    np.savetxt(path, scanned, fmt="%.5f")
    return find_rocks_in_cloud(path, unit="m", up="z", min_size_mm=35)


def test_all_rocks_are_found_at_their_places_with_their_sizes(found, three_rocks):
    table = found.table.sort_values("a_m", ascending=False)
    np.testing.assert_allclose(table[["x", "y"]], list(SIZES), atol=0.04)  # of visible sides
    for row, rock in zip(table.itertuples(), three_rocks.rocks, strict=True):
        whole = np.ptp(rock.points, axis=0)
        assert 0.8 * whole.max() < row.a_m < 1.15 * whole.max()
        assert row.a_m >= row.b_m >= row.c_m > 0
        assert 0.3 * ConvexHull(rock.points).volume < row.volume_m3 < ConvexHull(rock.points).volume
    assert set(np.unique(found.rock_of_cell)) == {0, 1, 2, 3}


def test_sizes_scale_with_the_cloud_and_its_minimum_size(scanned, found, tmp_path):
    np.savetxt(tmp_path / "cloud.txt", 10 * scanned, fmt="%.5f")
    larger = find_rocks_in_cloud(tmp_path / "cloud.txt", unit="m", up="z", min_size_mm=350)
    lengths = ["x", "y", "z", "a_m", "b_m", "c_m", "height_m", "diameter_m"]
    np.testing.assert_allclose(larger.table[lengths], 10 * found.table[lengths], rtol=0.05, atol=0.02)
    np.testing.assert_allclose(larger.table["volume_m3"], 1000 * found.table["volume_m3"], rtol=0.05)
    assert larger.area_m2 == pytest.approx(100 * found.area_m2, rel=0.01)


@pytest.mark.parametrize(("unit", "factor"), [("m", 1), ("mm", 1000)])
@pytest.mark.parametrize("up", ["z", "-z", "y", "-y", "x", "-x"])
def test_the_map_has_the_coordinates_of_the_file(scanned, tmp_path, up, unit, factor):
    """Cells of a rock are at its coordinates in the table, which are means of the points in the file."""
    column = "xyz".index(up[-1])
    turned = np.roll(scanned + np.array([250, -70, 9]), column - 2, axis=1)
    if up.startswith("-"):
        turned[:, [column, column - 1]] *= -1  # a rotation
    np.savetxt(tmp_path / "cloud.xyz", factor * turned, fmt="%.5f")
    found = find_rocks_in_cloud(tmp_path / "cloud.xyz", unit=unit, up=up, min_size_mm=35)
    columns, rows = found.axes
    assert len(found.table) == len(SIZES)
    assert {columns.name, rows.name} == set("xyz") - {up[-1]}
    for rock in found.table.to_dict("records"):
        row, column = np.mean(np.nonzero(found.rock_of_cell == rock["rock"]), axis=1) + 0.5
        for axis, cell in ((columns, column), (rows, row)):
            assert axis.start + axis.step * cell == pytest.approx(rock[axis.name], abs=0.04 * factor)


def test_a_cloud_without_rocks_reports_the_examined_ground(tmp_path, polarsim):
    random = np.random.default_rng(0)
    points = np.column_stack([random.uniform(0, 1, (40_000, 2)), random.normal(0, 0.0005, 40_000)])
    np.savetxt(tmp_path / "cloud.xyz", points, fmt="%.5f")
    options = ("--out", tmp_path / "rocks.csv", "--plot", tmp_path / "rocks.png")
    done = polarsim("rocks", tmp_path / "cloud.xyz", *options)
    assert done.returncode == 0, done.stderr
    first, second = done.stdout.splitlines()
    assert first.startswith("0 rocks on ")
    area = float(second.split()[1])
    assert area == pytest.approx(1, abs=0.05)
    spacing = float(second.partition("every ")[2].split()[0])
    assert 1 < spacing < 4  # mean of random points in plan: 2.5 mm
    assert all(text in second for text in ("35 mm", "z up", "--up", "--unit", "--min-size-mm"))


@pytest.mark.parametrize("up", ["z", "-z", "y", "-y", "x", "-x"])
def test_ground_is_level_for_every_axis(scanned, up):
    column = "xyz".index(up[-1])
    turned = np.roll(scanned, column - 2, axis=1)
    turned[:, column] *= -1 if up.startswith("-") else 1
    level, tilt = upright_points(turned, up)
    assert tilt < np.radians(4)  # a crater and a swell
    assert abs(np.median(level[:, 2])) < 0.02
    assert np.quantile(level[:, 2], 0.999) > 0.08  # rocks are above the ground
    mirrored = np.linalg.det(np.linalg.lstsq(turned - turned.mean(0), level - level.mean(0), rcond=None)[0])
    assert mirrored == pytest.approx(1)  # a rotation


def test_the_command_reads_ply_in_millimetres_and_writes_table_and_figure(scanned, found, tmp_path, polarsim):
    write_ply(tmp_path / "cloud.ply", Cloud(1000 * scanned, np.zeros_like(scanned)))
    options = ("--unit", "mm", "--plot", tmp_path / "rocks.png")
    done = polarsim("rocks", tmp_path / "cloud.ply", "--out", tmp_path / "rocks.csv", *options)
    assert done.returncode == 0, done.stderr
    assert done.stdout.startswith("3 rocks")
    table = tables.read_csv(tmp_path / "rocks.csv")
    np.testing.assert_allclose(table["a_m"], found.table["a_m"], rtol=0.02)
    np.testing.assert_allclose(table["x"], 1000 * found.table["x"], atol=2)
    assert (tmp_path / "rocks.png").stat().st_size > 10_000


@pytest.mark.parametrize("suffix", tables.TABLE_SUFFIXES)
def test_tables_are_written_by_suffix(found, tmp_path, suffix):
    path = tmp_path / f"rocks{suffix}"
    tables.write_by_suffix(path, found.table)
    read = {".csv": pd.read_csv, ".json": pd.read_json, ".parquet": pd.read_parquet}[suffix](path)
    np.testing.assert_allclose(read["b_m"], found.table["b_m"], rtol=1e-4)


@pytest.mark.parametrize(
    ("factor", "up", "size", "words"),
    [
        (1000, "z", 35, "--unit"),  # millimetres read as metres
        (0.001, "z", 35, "--unit"),
        (1, "y", 35, "--up"),
        (1, "z", 5, "--min-size-mm"),
    ],
)
def test_implausible_input_is_an_error_with_a_remedy(scanned, tmp_path, factor, up, size, words):
    np.savetxt(tmp_path / "cloud.xyz", factor * scanned, fmt="%.7f")
    with pytest.raises(FormatError, match=words) as error:
        find_rocks_in_cloud(tmp_path / "cloud.xyz", unit="m", up=up, min_size_mm=size)
    assert error.value.path == tmp_path / "cloud.xyz"


@pytest.mark.parametrize("number", [1, 2, 3, 4, 8, 9, 10, 100, MIN_POINTS - 1])
def test_a_cloud_of_too_few_points_is_an_error_with_both_numbers(tmp_path, polarsim, number):
    np.savetxt(tmp_path / "cloud.xyz", np.random.default_rng(0).random((number, 3)), fmt="%.5f")
    done = polarsim("rocks", tmp_path / "cloud.xyz", "--out", tmp_path / "rocks.csv")
    assert done.returncode == 1
    (line,) = done.stderr.splitlines()
    assert f"{tmp_path / 'cloud.xyz'}: " in line
    assert f" {number}," in line
    assert str(MIN_POINTS) in line
    assert not (tmp_path / "rocks.csv").exists()


@pytest.mark.parametrize(
    "points",
    [
        np.zeros((1000, 3)),
        np.linspace([0, 0, 0], [1, 0, 0], 1000),
        np.linspace([0, 0, 0], [0, 0, 1], 1000),
        np.repeat([[0, 0, 0], [1, 1, 0]], 500, axis=0),
    ],
    ids=["one place", "level line", "upright line", "two places"],
)
def test_a_cloud_without_a_surface_is_an_error_of_one_line(tmp_path, polarsim, points):
    np.savetxt(tmp_path / "cloud.xyz", points, fmt="%.5f")
    done = polarsim("rocks", tmp_path / "cloud.xyz", "--out", tmp_path / "rocks.csv")
    assert done.returncode == 1
    assert done.stderr.splitlines()[-1].startswith(f"error: {tmp_path / 'cloud.xyz'}: ")


@pytest.mark.parametrize(
    ("complete", "smallest"),
    [(30, ["--min-size-mm", 60]), (59.9, ["--min-size-mm", 60]), (34, []), (1, ["--min-size-mm", 10000])],
)
def test_a_fit_of_rocks_that_are_not_searched_for_is_a_usage_error(tmp_path, polarsim, complete, smallest):
    options = ("--out", tmp_path / "rocks.csv", "--complete-mm", complete, *smallest)
    done = polarsim("rocks", tmp_path / "missing.xyz", *options)  # before the cloud is read
    assert done.returncode == 2
    assert "--complete-mm" in done.stderr
    assert "--min-size-mm" in done.stderr


def test_a_fit_from_the_minimum_size_is_valid(scanned, tmp_path, polarsim):
    np.savetxt(tmp_path / "cloud.xyz", scanned, fmt="%.5f")
    options = ("--out", tmp_path / "rocks.csv", "--complete-mm", 60, "--min-size-mm", 60)
    done = polarsim("rocks", tmp_path / "cloud.xyz", *options)
    assert done.returncode == 0, done.stderr
    assert "at least 60 mm" in done.stdout


def test_a_cloud_of_rocks_without_ground_is_refused(three_rocks, tmp_path):
    random = np.random.default_rng(0)
    parts = [rock.points.mean(0) + random.normal(0, 0.03, (20_000, 3)) for rock in three_rocks.rocks]
    np.savetxt(tmp_path / "rocks.xyz", np.concatenate(parts), fmt="%.5f")
    with pytest.raises(ReconstructionError, match="ground"):
        find_rocks_in_cloud(tmp_path / "rocks.xyz", unit="m", up="z", min_size_mm=35)


def test_points_between_surfaces_are_stray():
    x, y = (0.005 * part.ravel() for part in np.meshgrid(np.arange(40), np.arange(40)))
    surface = np.stack([x, y, np.zeros_like(x)], axis=1)
    mixed = np.array([[0.1, 0.1, z] for z in (0.03, 0.06, 0.09)])
    assert np.flatnonzero(stray_points(np.concatenate([surface, mixed]))).tolist() == [1600, 1601, 1602]


def test_las_files_need_the_extra_or_are_read(scanned, tmp_path):
    try:
        import laspy
    except ModuleNotFoundError:
        (tmp_path / "cloud.las").write_bytes(b"LASF")
        with pytest.raises(ExtraError, match=r"polarsim\[las\]"):
            read_any_cloud(tmp_path / "cloud.las")
        return
    header = laspy.LasHeader(point_format=0, version="1.2")
    header.scales = [1e-4] * 3
    cloud = laspy.LasData(header)
    cloud.x, cloud.y, cloud.z = scanned.T
    cloud.write(tmp_path / "cloud.las")
    np.testing.assert_allclose(read_any_cloud(tmp_path / "cloud.las"), scanned, atol=1e-4)


INVALID = [[np.nan, 0, 0], [0, np.inf, 0], [0, 0, -np.inf], [np.nan, np.inf, 0]]
WITHOUT_HIT = [[np.nan] * 3] * 2


@pytest.mark.parametrize("suffix", ["xyz", "txt", "pts", "ply"])
@pytest.mark.parametrize(
    ("rows", "numbers"), [([], []), (INVALID, [4]), (WITHOUT_HIT, [2]), ([*INVALID, *WITHOUT_HIT], [2, 4])]
)
def test_points_without_finite_coordinates_are_counted(tmp_path, caplog, suffix, rows, numbers):
    points = np.array([*np.arange(30.0).reshape(10, 3), *rows])
    path = tmp_path / f"cloud.{suffix}"
    if suffix == "ply":
        header = ["ply", "format binary_little_endian 1.0", f"element vertex {len(points)}"]
        header += [f"property float {name}" for name in "xyz"] + ["end_header\n"]
        path.write_bytes("\n".join(header).encode() + points.astype("<f4").tobytes())
    else:
        np.savetxt(path, points, fmt="%.3f")
    np.testing.assert_allclose(read_any_cloud(path), points[:10])
    messages = [record.getMessage() for record in caplog.records if record.levelname == "WARNING"]
    assert [message.split(" points")[0] for message in messages] == [
        f"{path}: {number} of {len(points)}" for number in numbers
    ]


def test_a_cloud_without_finite_points_is_an_error(tmp_path):
    np.savetxt(tmp_path / "cloud.xyz", [*INVALID, *WITHOUT_HIT])
    with pytest.raises(FormatError, match="no point"):
        read_any_cloud(tmp_path / "cloud.xyz")


def test_the_command_reports_skipped_points(scanned, tmp_path, polarsim):
    np.savetxt(tmp_path / "cloud.xyz", np.concatenate([scanned, INVALID]), fmt="%.5f")
    done = polarsim("rocks", tmp_path / "cloud.xyz", "--out", tmp_path / "rocks.csv")
    assert done.returncode == 0
    assert f"4 of {len(scanned) + 4} points" in done.stderr


def test_an_unknown_extension_is_refused(tmp_path):
    (tmp_path / "cloud.e57").write_bytes(b"")
    with pytest.raises(FormatError, match=r"\.las"):
        read_any_cloud(tmp_path / "cloud.e57")
