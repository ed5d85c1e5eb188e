import numpy as np
import pandas as pd
import pytest

from polarsim.formats import obj
from polarsim.geometry.meshes import Mesh
from polarsim.geometry.poses import Pose, camera_pose
from polarsim.run_files.materials import FittedMaterial, FittedMaterials, write_materials
from polarsim.run_files.rigs import LocalisedRig, write_localised
from polarsim.run_files.scene import read_terrain
from polarsim.scoring.materials import held_out_metrics, score_materials
from polarsim.site import polar
from tests.support.polar_rig import default_rig
from tests.support.polar_survey import SANDBOX

TRANSLATION = np.array([0.3, -0.1, 0.05])  # of the true frame
STEPS = ("unfitted", "constant_albedo", "fitted")
ERRORS = {step: {"median_stops": number, "rms_stops": number + 0.5} for number, step in enumerate(STEPS)}
CHECK = {"azimuth": "30", "pixels": {"count": 10, **ERRORS}}


def grid(low, high, z):
    """A level square of 1 cm triangles."""
    axis = np.arange(low, high + 0.005, 0.01)
    x, y = (part.ravel() for part in np.meshgrid(axis, axis, indexing="ij"))
    k = (np.arange(len(axis) - 1)[:, None] * len(axis) + np.arange(len(axis) - 1)).ravel()
    faces = np.concatenate(
        [np.stack([k, k + len(axis), k + 1], 1), np.stack([k + 1, k + len(axis), k + len(axis) + 1], 1)]
    )
    return Mesh(np.stack([x, y, np.full_like(x, z)], axis=1), faces)


@pytest.fixture
def scored(tmp_path):
    """Score fitted factors of ground and rock vertices with errors `off`, on an arbitrary scale."""

    def score(off_ground, off_rock, looks=1, albedo_known=True):
        for name, mesh in ((obj.ground_name(1), grid(0, 0.5, 0)), (obj.rock_name(1, 3), grid(0.1, 0.2, 0.1))):
            obj.write_obj(tmp_path / "meshes" / name, mesh, "part")
        mesh = read_terrain(tmp_path / "meshes", 1, SANDBOX)
        rock = mesh.vertices[:, 2] > 0.05
        true = np.where(rock, 0.4, 0.2 + 0.1 * mesh.vertices[:, 0])
        factor = 3 * true * np.where(rock, 1 + off_rock, 1 + off_ground)
        found = FittedMaterials(
            {"hapke": FittedMaterial({}, {}, {}, factor.astype(np.float32), CHECK)},
            np.full(len(true), looks),
        )
        write_materials(tmp_path / "materials", mesh, found)
        pose = camera_pose(np.array([2.0, 0, 1]), np.pi, 0.4)
        write_localised(tmp_path / "cameras" / "PosA.json", LocalisedRig(default_rig(), pose, "test"))
        translated = Pose(np.eye(3), TRANSLATION) @ pose
        write_localised(tmp_path / "truth" / "cameras" / "PosA.json", LocalisedRig(default_rig(), translated, "truth"))
        table = pd.DataFrame(mesh.vertices + TRANSLATION, columns=list("xyz")).assign(
            rock=np.where(rock, 5, -1), albedo=true, pixels=9
        )
        if albedo_known:
            table.to_parquet(tmp_path / "truth" / "albedo.parquet")
        score_materials(
            site=polar(),
            terrain=1, materials=tmp_path / "materials", meshes=tmp_path / "meshes", cameras=tmp_path / "cameras",
            truth=tmp_path / "truth", evaluation=tmp_path / "evaluation.csv",
        )  # fmt: skip
        table = pd.read_csv(tmp_path / "evaluation.csv")
        return {(row.subject, row.metric): row.value for row in table.itertuples()}

    return score


def test_true_albedo_on_any_scale_and_in_any_frame_is_without_error(scored):
    metrics = scored(0, 0)
    for thing in ("ground", "rocks"):
        assert metrics[f"hapke, {thing}", "albedo_error_median"] < 0.003  # means of neighbours
    assert metrics["hapke, ground", "constant_error_median"] == pytest.approx(0.0125 / 0.225, rel=0.05)
    assert metrics["hapke, rocks", "constant_error_median"] == pytest.approx(0.4 / 0.225 - 1, rel=0.01)


def test_rocks_have_the_scale_of_the_ground(scored):
    assert scored(0, -0.2)["hapke, rocks", "albedo_error_median"] == pytest.approx(0.2, abs=0.01)
    assert scored(0.25, 0)["hapke, rocks", "albedo_error_median"] == pytest.approx(0.2, abs=0.01)


def test_vertices_that_are_never_lit_are_not_scored(scored):
    assert not [subject for subject, _ in scored(0, 0, looks=0) if "held-out" not in subject]


def test_without_true_albedo_only_errors_on_photos_are_computed(scored):
    metrics = scored(0, 0, albedo_known=False)
    assert set(metrics) == {
        ("hapke, held-out pixels", f"{step}_{kind}") for step in STEPS for kind in ("median", "rms")
    }
    assert metrics["hapke, held-out pixels", "fitted_rms"] == 2.5


def test_a_fit_without_held_out_errors_has_no_metrics():
    assert held_out_metrics("hapke", {}) == []
