"""Paths of a run follow its configuration and the wildcards of a job."""

from types import SimpleNamespace

import pytest

from polarsim.config import parse_config
from polarsim.detect.options import PACKAGED
from polarsim.paths import GapPaths, RoverPaths, RunPaths
from polarsim.render.options import RenderOptions


@pytest.fixture(autouse=True)
def without_release(monkeypatch):
    """Unset the variable that replaces the root of a release."""
    monkeypatch.delenv("POLAR_SIM_ROOT", raising=False)


def paths(kind: str = "analog", root: object = "data", **sections: object) -> RunPaths:
    content = {"run": "one", "terrains": [1, 3], "positions": ["A"], "source": {"kind": kind, "root": str(root)}}
    return RunPaths(parse_config(content | sections))


def job(**wildcards: str) -> SimpleNamespace:
    return SimpleNamespace(run="one", **wildcards)


@pytest.fixture
def release(tmp_path):
    """A root with annotated boxes of terrain 1, polygons of terrain 3, a cover photo and a mesh of each."""
    (tmp_path / "Labels/Terrain01").mkdir(parents=True)
    (tmp_path / "SegmentationLabels/terrain03/labels").mkdir(parents=True)
    for terrain in ("01", "03"):
        mesh = tmp_path / f"TerrainMeshes/Terrain{terrain}/terrain{terrain}_rock1.obj"
        mesh.parent.mkdir(parents=True)
        mesh.touch()
        (tmp_path / "CoverPhotoOfIndices").mkdir(exist_ok=True)
        (tmp_path / f"CoverPhotoOfIndices/cover_photo_indexed_{terrain}_A.png").touch()
    return tmp_path


def test_raw_data_of_the_analog_are_receipts_and_of_a_release_files(release):
    assert paths().raw_data(job(terrain="03")) == ["data/receipts/Terrain03.json"]
    found = paths("release", release).raw_data(job(terrain="01"))
    assert found == [str(release / "TerrainMeshes/Terrain01/terrain01_rock1.obj")]


def test_labels_are_scored_against_truth_or_people(release):
    analog, published = paths(), paths("release", release)
    assert analog.true_labels(job(terrain="01")) == "data/truth/Terrain01/labels.parquet"
    assert analog.annotated_labels(job(terrain="01")) is None
    assert analog.scored_terrains == ["01", "03"]
    assert published.truth(job(terrain="01")) is None
    assert published.true_labels(job(terrain="01")) == str(release / "Labels/Terrain01")
    assert published.scored_terrains == ["01"]
    assert published.annotated_polygons(job(terrain="01")) == []
    assert published.annotated_polygons(job(terrain="03")) == str(release / "SegmentationLabels/terrain03/labels")


def test_cameras_and_rocks_read_range_maps_of_photos_without_scans():
    scanned, photographed = paths(), paths(source={"kind": "analog", "root": "data", "scans": False})
    assert scanned.inventory_of_ranges == "results/{run}/acquire/Terrain{terrain}/inventory.json"
    assert scanned.calibration_of_rig == "results/{run}/acquire/Terrain{terrain}/calibration.json"
    assert not scanned.measures_ranges
    assert scanned.range_maps == []
    assert photographed.inventory_of_ranges == "results/{run}/cameras/ranges/Terrain{terrain}/inventory.json"
    assert photographed.calibration_of_rig == "results/{run}/cameras/ranges/Terrain{terrain}/calibration.json"
    assert photographed.measures_ranges


def test_corrections_belong_to_their_terrain(tmp_path):
    for name in ("01_A_off_30_L_0256.txt", "03_A_off_30_L_0256.txt", "all.json"):
        (tmp_path / name).touch()
    run = paths(labels={"corrections": str(tmp_path)})
    assert run.corrections(job(terrain="01")) == [str(tmp_path / "01_A_off_30_L_0256.txt"), str(tmp_path / "all.json")]


@pytest.mark.parametrize(
    ("domain", "pictures", "labels"),
    [
        ("analog", ["results/one/acquire/photos.parquet"], ["results/one/labels/labels.parquet"]),
        (
            "hapke",
            ["results/one/renders/hapke/Terrain01", "results/one/renders/hapke/Terrain03"],
            ["results/one/renders/labels.parquet"],
        ),
        ("views", ["v/index.csv"], []),
    ],
)
def test_pictures_and_labels_of_each_kind_of_domain(domain, pictures, labels):
    run = paths(detect={"views": "v"})
    assert run.pictures(job(domain=domain)) == pictures
    assert run.labels_of_domain(job(domain=domain)) == labels


def test_a_run_without_photos_has_no_tables_of_detectors(release):
    published = paths("release", release)
    assert published.tables_of_detectors() == published.figures_of_detectors() == []
    assert published.photos_of_terrain == []
    assert "errata.html" in published.further_pages()
    assert "errata.html" not in paths().further_pages()


def test_a_component_of_the_ablation_takes_truth_or_the_run():
    components = {"pose": {"cameras": "truth"}, "labels": {"labels": "propagated"}}
    gap = GapPaths(paths(gap={"components": components}))
    assert gap.rendered == ["pose"]
    assert gap.cameras(job(component="pose")) == "results/{run}/gap/truth/cameras/Terrain{terrain}"
    assert gap.meshes(job(component="pose")) == "results/{run}/meshes/Terrain{terrain}"
    folder = "results/{run}/detect/{split}/seed{seed}/predictions"
    assert gap.predictions() == [
        path
        for trained in ("analog", "hapke")
        for path in (
            f"{folder}/{trained}_on_analog.parquet",
            f"{folder}/{trained}_on_hapke.parquet",
            f"results/{{run}}/gap/{{split}}/seed{{seed}}/predictions/{trained}_on_pose.parquet",
            f"{folder}/{trained}_on_hapke.parquet",
        )
    ]
    assert gap.labels()[-2:] == ["results/{run}/gap/twins/pose/labels.parquet", "results/one/labels/labels.parquet"]


def test_a_component_with_fitted_materials_is_rendered_as_fitted_twins():
    components = {"pose": {"cameras": "truth"}, "material": {"materials": "fitted", "render": {"vignetting": False}}}
    gap = GapPaths(paths(gap={"components": components}))
    fields = "results/{run}/renders/light/Terrain{terrain}.json"
    assert [gap.light(job(component=name)) for name in components] == [[], fields]
    plain, fitted = (RenderOptions(**gap.options(job(component=name))) for name in components)
    assert (plain.fitted_domains, fitted.fitted_domains) == ((), ("hapke",))
    assert (fitted.as_fitted().lamp_radius_m, fitted.as_fitted().vignetting) == (None, False)


def rover(**options: object) -> RoverPaths:
    drives = {"run": True, "seeds": [4, 5], "world": {"terrains": [3, 1]}, "cameras": {"views": ["front_end_cam"]}}
    return RoverPaths(paths(rover=drives | options))


def test_a_drive_with_a_detector_has_detections_in_every_picture_set():
    detector = {"cameras": {"views": ["front_end_cam"], "onboard": {"weights": "packaged"}}}
    without, drives = rover(), rover(**detector)
    assert without.detections() == without.shown_detections() == without.weights == []
    folder = "results/{run}/rover/seed{seed}/front_end_cam"
    assert drives.detections() == [f"{folder}/{name}/detections.parquet" for name in drives.picture_sets]
    first = drives.shown_detections()
    assert first in [path.replace("seed{seed}", "seed4") for path in drives.detections()]
    assert drives.weights == str(PACKAGED)
    assert drives.terrains == ["03", "01"]


@pytest.mark.parametrize(("kind", "folder"), [("analog", "meshes"), ("release", "repaired")])
def test_drives_are_over_closed_rocks(kind, folder):
    drives = {"run": True, "world": {"terrains": [3, 1]}}
    expected = [f"results/{{run}}/{folder}/Terrain{terrain}" for terrain in ("03", "01")]
    assert RoverPaths(paths(kind, rover=drives)).meshes == expected


def test_labels_of_every_view_are_written_with_its_pictures():
    folder = "results/{run}/rover/seed{seed}/front_end_cam"
    suns = rover().suns
    expected = [f"{folder}/poses.parquet", *(f"{folder}/{sun}_truth.parquet" for sun in suns)]
    assert rover().pictures_of_drive() == expected


def test_only_modes_with_pictures_depend_on_detector_and_renderer():
    autonomy = {"run": True, "modes": ["truth", "detector"], "detectors": ["packaged"]}
    drives = rover(autonomy=autonomy)
    by_mode = {case.mode: job(case=name) for name, case in drives.cases.items()}
    assert drives.weights_of_case(by_mode["detector"]) == str(PACKAGED)
    assert drives.weights_of_case(by_mode["truth"]) == []
    assert drives.detector_of_case(by_mode["truth"]) is None
    assert set(drives.render_of_case(by_mode["truth"])) < set(drives.render_of_case(by_mode["detector"]))
    assert set(drives.cameras_of_case(by_mode["truth"])) < set(drives.cameras_of_case(by_mode["detector"]))
