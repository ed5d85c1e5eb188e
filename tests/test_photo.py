import pytest
from hypothesis import given
from hypothesis import strategies as st

from polarsim.errors import LabelError
from polarsim.photo import PhotoKey
from polarsim.site import polar

POLAR = polar()
ALL = [key for terrain in range(1, 14) for key in POLAR.photos_of(terrain)]


def test_the_grid_has_as_many_photos_as_nasa_published():
    assert len(ALL) == 5190  # 3,460 + 1,730, the POLAR-Sim paper
    assert len(set(ALL)) == 5190


@pytest.mark.parametrize(
    ("terrain", "pairs"), [(1, 140), (2, 186), *((terrain, 222) for terrain in range(3, 13)), (13, 49)]
)
def test_every_terrain_has_its_stated_number_of_pairs(terrain, pairs):
    assert len(list(POLAR.photos_of(terrain))) == 2 * pairs


def test_a_key_is_written_as_in_the_release():
    assert str(PhotoKey(1, "A", "off", "180", "L", 16)) == "01_A_off_180_L_0016"


@pytest.mark.parametrize(
    "name",
    [
        "04_A_off_30_R_0512 copy",
        "04_A_off_30_R_0512good",
        "04_A_on_180_R_1028",
        "04_A_off_30_R_0512.txt",
        "4_A_off_30_R_0512",
        "14_A_off_30_R_0512",
        "00_A_off_30_R_0512",
        "04_H_off_30_R_0512",
        "04_A_off_90_R_0512",
        "04_A_off_30_R_0008",
        "04_A_off_30_R_512",
        "04_A_off_30_R_0512\n",
        "04_A_off_30_R_٠٥١٢",
        "04_D_off_30_R_0512",
        "01_A_off_30_R_2048",
        "04_A_off_30_R_0016",
        "04_A_off_30_R_8192",
        "",
        ".DS_Store",
    ],
)
def test_names_that_are_no_key_are_refused_by_name(name):
    with pytest.raises(LabelError, match=r"is not a photo key|expected") as caught:
        POLAR.key(name)
    assert repr(name) in str(caught.value)


@pytest.mark.parametrize(
    ("name", "wrong"),
    [
        ("3_A_on_350_R_256", ("terrain", "exposure")),
        ("03_A_on_45_R_0256", ("azimuth",)),
        ("03_Z_of_350_left_0256", ("position", "light", "camera")),
        ("03_D_on_350_R_0256", ("position",)),
        ("03_A_on_350_R_4096", ("exposure",)),
    ],
)
def test_each_wrong_field_of_a_key_is_named_and_no_other(name, wrong):
    with pytest.raises(LabelError) as caught:
        POLAR.key(name)
    told = str(caught.value).partition(repr(name))[2]
    named = {
        field for field in ("terrain", "position", "light", "azimuth", "camera", "exposure") if f" {field} " in told
    }
    assert set(wrong) <= named <= {*wrong, "terrain", "azimuth"}  # these fields determine the valid values


any_key = st.builds(
    PhotoKey,
    terrain=st.integers(1, 13),
    position=st.sampled_from("ABCDEFG"),
    light=st.sampled_from(["on", "off"]),
    azimuth=st.sampled_from(["no", "30", "180", "270", "350"]),
    camera=st.sampled_from("LR"),
    exposure_ms=st.integers(3, 14).map(lambda n: 2**n),
)


@given(any_key)
def test_a_key_is_accepted_where_its_terrain_has_the_position_and_the_exposure(key):
    possible = key.position in POLAR.positions_of(key.terrain) and key.exposure_ms in POLAR.exposures_of(
        key.terrain, key.azimuth
    )
    if possible:
        assert POLAR.key(str(key)) == key
    else:
        with pytest.raises(LabelError):
            POLAR.key(str(key))


def test_terrain_1_has_shorter_exposures_and_longer_ones_only_without_sun():
    ends = [
        (times[0], times[-1])
        for times in (POLAR.exposures_of(1, "30"), POLAR.exposures_of(3, "30"), POLAR.exposures_of(3, "no"))
    ]
    assert ends == [(16, 1024), (32, 2048), (32, 8192)]


def test_parts_of_a_key_name_station_view_and_bracket():
    key = PhotoKey.parse("11_C_on_350_R_0064")
    assert (key.station, key.view, key.bracket) == ((11, "C"), (11, "C", "R"), (11, "C", "on", "350", "R"))
    assert str(key.with_exposure(2048)) == "11_C_on_350_R_2048"


@pytest.mark.parametrize(("exposure_ms", "stops"), [(64, 2), (256, 0), (2048, 3)])
def test_stops_count_doublings_from_the_usual_exposure(exposure_ms, stops):
    assert PhotoKey.parse(f"03_A_off_180_L_{exposure_ms:04d}").stops_from(256) == stops


@given(
    key=st.sampled_from(ALL),
    folder=st.sampled_from(
        ["", "data/", "..\\upload\\4\\", "https://host/a-b/", "/data/local-files/?d=", "/data/?d=x y/"]
    ),
    prefix=st.sampled_from(["", "cb0618f6-"]),
    ending=st.sampled_from(["", ".png", ".jpeg", ".txt", "_png.rf.0123abcdEF.jpg", "_jpg.rf.Ab9", ".png?token=a-b/c"]),
)
def test_a_key_is_found_in_names_as_tools_store_them(key, folder, prefix, ending):
    assert POLAR.key_of_picture(f"{folder}{prefix}{key}{ending}") == key


@pytest.mark.parametrize(
    "name",
    [
        "",
        "holiday.png",
        "{} copy.png",
        "{}(1).png",
        "x{}.png",
        "{}_left.png",
        "{}-1.png",
        "{}.png.jpg",
        "{}\n",
        "14{}.png",
    ],
)
def test_a_name_with_anything_else_before_or_behind_its_key_is_refused(name):
    with pytest.raises(LabelError):
        POLAR.key_of_picture(name.format(ALL[0]))
