"""Paths of a configuration are checked before any job starts."""

import os
from pathlib import Path

import pytest

from polarsim.config import parse_config
from polarsim.errors import ConfigError, PolarsimError
from polarsim.running.inputs import check_paths

ROVER = {"run": True, "world": {"terrains": [3]}}
BOX = "0 0.500000 0.500000 0.100000 0.100000\n"
SEED, CORRECTED = "03_A_off_30_L_0256", "03_A_off_180_R_0512"


@pytest.fixture
def data(tmp_path, monkeypatch):
    """A release with one seed, and a folder with one correction."""
    monkeypatch.delenv("POLAR_SIM_ROOT", raising=False)  # replaces the root of a release
    for path in (tmp_path / f"release/Labels/Terrain03/{SEED}.txt", tmp_path / f"corrections/{CORRECTED}.txt"):
        path.parent.mkdir(parents=True)
        path.write_text(BOX)
    (tmp_path / "empty").mkdir()
    (tmp_path / "file").write_text("")
    return tmp_path


def checked(data, **sections):
    content = {
        "terrains": [3],
        "source": {"kind": "release", "root": str(data / "release")},
        **sections,
    }
    config = parse_config(content)
    check_paths(config)
    return config


def test_a_release_with_a_seed_a_correction_and_an_excluded_seed_passes(data):
    checked(data, labels={"corrections": str(data / "corrections"), "excluded_annotations": [SEED, CORRECTED]})
    checked(data, labels={"seeds": {"root": str(data / "release")}}, scoring={"annotated_root": str(data / "release")})


@pytest.mark.parametrize("wrong", ["missing", "file", "empty"])
@pytest.mark.parametrize(
    ("key", "sections"),
    [
        ("source.root", lambda path: {"source": {"kind": "release", "root": path}}),
        ("labels.seeds.root", lambda path: {"labels": {"seeds": {"root": path}}}),
        ("labels.corrections", lambda path: {"labels": {"corrections": path}}),
        ("scoring.annotated_root", lambda path: {"scoring": {"annotated_root": path}}),
        ("detect.views", lambda path: {"detect": {"views": path}}),
        ("detect.training.pretrained", lambda path: {"detect": {"training": {"pretrained": path}}}),
        ("rover.fine_tuning.drives", lambda path: {"rover": {**ROVER, "fine_tuning": {"drives": [path]}}}),
        ("rover.soil.table", lambda path: {"rover": {**ROVER, "soil": {"table": path}}}),
    ],
)
def test_a_path_without_usable_content_is_an_error_that_names_it(data, wrong, key, sections):
    wants_file = key in ("detect.training.pretrained", "rover.soil.table")
    path = data / ("missing" if wants_file and wrong == "file" else wrong)
    with pytest.raises(PolarsimError) as caught:
        checked(data, **sections(str(path)))
    assert str(path) in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("name", "section"),
    [
        ("03_A_off_30_L_0128", {}),  # a photo of the run, but neither seed nor correction
        ("04_A_off_30_L_0256", {}),  # another terrain
        (CORRECTED, {"corrections": None}),
        (SEED, {"seeds": {"azimuths": ["180"]}}),
    ],
)
def test_an_excluded_photo_that_is_neither_seed_nor_correction_is_an_error(data, name, section):
    options = {"corrections": str(data / "corrections"), "excluded_annotations": [name], **section}
    with pytest.raises(PolarsimError):
        checked(data, labels=options)


@pytest.mark.parametrize(
    ("name", "section"),
    [
        ("04_A_off_30_L_0256", {}),
        ("03_A_off_30_L_0256", {"grid": {"exposures_ms": [512]}}),
        ("03_A_off_30_L_0256", {"grid": {"cameras": ["R"]}}),
        ("03_B_off_30_L_0256", {"positions": ["A"]}),
    ],
)
def test_a_correction_of_no_photo_of_the_run_is_an_error(data, name, section):
    (data / f"empty/{name}.txt").write_text(BOX)
    with pytest.raises(ConfigError) as caught:
        checked(data, labels={"corrections": str(data / "empty")}, **section)
    assert name in caught.value.reason
    assert caught.value.path == data / "empty"


def test_the_home_folder_is_expanded_in_every_path(data, monkeypatch):
    monkeypatch.setenv("HOME", str(data))
    config = checked(
        data,
        source={"kind": "release", "root": "~/release"},
        labels={"seeds": {"root": "~/release"}, "corrections": "~/corrections"},
        scoring={"annotated_root": "~/release"},
    )
    assert config.source.root == data / "release"
    assert config.labels.corrections == data / "corrections"
    assert config == checked(
        data,
        labels={"seeds": {"root": str(data / "release")}, "corrections": str(data / "corrections")},
        scoring={"annotated_root": str(data / "release")},
    )


@pytest.mark.parametrize("path", ["", "  ", "~nobody-of-this-name/x"])
def test_an_empty_path_and_an_unknown_home_are_errors(path):
    with pytest.raises(ConfigError) as caught:
        parse_config({"source": {"kind": "files", "root": path}})
    assert "source.root" in caught.value.reason or "root" in caught.value.reason


def test_data_that_are_still_to_be_made_or_fetched_may_be_missing(tmp_path):
    for source in (
        {"kind": "analog"},
        {"kind": "files", "urls": {"Terrain03_MeanDistr.zip": "https://example.org/a.zip"}},
    ):
        check_paths(parse_config({"terrains": [3], "source": {**source, "root": str(tmp_path / "later")}}))


def test_paths_of_sections_that_do_not_run_are_not_read(data):
    checked(data, detect={"run": False, "views": str(data / "missing")})


def test_relative_paths_count_from_the_working_folder(data, monkeypatch):
    monkeypatch.chdir(data)
    assert checked(Path(), labels={"corrections": "corrections"}).labels.corrections == Path("corrections")
    assert os.fspath(checked(Path()).source.root) == "release"
