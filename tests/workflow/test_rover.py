"""The rover in the workflow: no jobs without drives, and a complete small drive."""

import json
import re
import subprocess
from pathlib import Path

import pandas as pd
import pytest
import yaml

from polarsim.config import parse_config
from polarsim.detect.options import PACKAGED, PACKAGED_ROVER, PredictionOptions
from polarsim.errors import ConfigError
from polarsim.rover.perception.options import OnboardDetector
from polarsim.running.configuration import read_configs
from tests.rover.drives import DEMO, SMALL, configured, write_meshes
from tests.workflow.conftest import planned


def test_the_demo_does_not_drive(dry_run):
    done = dry_run("--configfile", "config/config.yaml")
    jobs = planned(done)
    assert not {name for name in jobs if "rover" in name or "drive" in name}
    assert "results/demo/rover" not in done.stdout + done.stderr


@pytest.mark.parametrize(("name", "drives", "views"), [("overlays/rover", 3, 2), ("rover_release", 10, 7)])
def test_a_job_a_drive_and_one_a_view_of_it(dry_run, tmp_path, name, drives, views):
    root = tmp_path / "release"
    for terrain in (1, 4, 11):
        (root / f"Labels/Terrain{terrain:02d}").mkdir(parents=True)
        (root / f"Labels/Terrain{terrain:02d}/{terrain:02d}_A_off_30_L_0256.txt").write_text("0 0.5 0.5 0.1 0.1\n")
    done = dry_run("rover", "--configfile", f"config/{name}.yaml", POLAR_SIM_ROOT=str(root))
    jobs = planned(done)
    assert (jobs["drive_rover"], jobs["render_drive"], jobs["write_bag"]) == (drives, drives * views, drives)
    assert jobs["measure_drive"] == drives
    assert jobs["cut_rocks"] == 1
    assert jobs["detect_drive"] == drives  # by the packaged detector
    assert jobs.get("film_drive") == (None if name == "overlays/rover" else drives)
    assert jobs["draw_front"] == jobs["draw_drive"] == jobs["summarise_drives"] == jobs["summarise_onboard"] == 1
    assert "train_detector" not in jobs


def test_a_drive_of_all_that_it_depends_on_then_tables_and_figures(checkout, snakemake):
    asked = {"modes": ["truth", "stereo", "both", "blind"], "headlights": ["off", "on"]}
    asked |= {"detectors": ["packaged", "hapke"], "poses": ["truth"]}
    cameras = {"suns": ["1", "3"], "exposures_ms": [64, 128]}
    content = {"rover": {"autonomy": asked, "seeds": [5], "cameras": cameras, "bags": False}}
    content["rover"]["world"] = {"dem": {"path": "site.tif"}}
    (checkout / "site.tif").touch()
    (checkout / "config/lights.yaml").write_text(yaml.safe_dump(content | {"detect": {"seeds": [0, 1]}}))
    files = [f"config/{name}.yaml" for name in ("overlays/rover", "overlays/rover_autonomy", "lights")]
    done = snakemake(checkout, "rover_autonomy", "--dry-run", "--configfile", *files)
    assert done.returncode == 0, done.stdout + done.stderr
    text = done.stdout + done.stderr
    jobs = planned(done)
    lights = [f"{sun}_{ms}_{lit}_hapke" for sun in "13" for ms in ("0064", "0128") for lit in ("off", "on")]
    own = {"truth", "blind", *(f"stereo_{light}" for light in lights)}
    own |= {f"both_{light}_{name}" for light in lights for name in ("packaged", "hapke-seed0", "hapke-seed1")}
    cases = {f"{case}_seed5" for case in own}
    assert set(re.findall(r"output: results/demo/rover/autonomy/([\w-]+)/figures\.parquet", text)) == cases
    assert (jobs["drive_alone"], jobs["drive_with_pictures"]) == (2, 8 + 24)
    assert len(cases) == 2 + 8 + 24
    planned_rules = re.findall(r"rule (drive_\w+):(?:\n    .*)*?\n    wildcards: .*case=(\w+?)_", text)
    assert {mode: rule for rule, mode in planned_rules} == {
        "truth": "drive_alone", "blind": "drive_alone", "stereo": "drive_with_pictures", "both": "drive_with_pictures",
    }  # fmt: skip
    assert len(re.findall(r"Terrain11, site\.tif, \S+/autonomy\.npz", text)) == len(cases)  # other ground, other drives
    trained = re.findall(r"site\.tif.*detect/position/(seed\d)/detectors/hapke\.pt", text)
    assert [trained.count(seed) for seed in ("seed0", "seed1")] == [8, 8]
    assert jobs["summarise_autonomy"] == jobs["rank_detectors"] == jobs["draw_autonomy"] == jobs["cut_rocks"] == 1
    assert "results/demo/detect/ipd.parquet" in re.search(r"rule rank_detectors:\n +input: (.*)", text)[1]
    assert "drive_rover" not in jobs
    for name in ("tables/rover_autonomy_effects.csv", "figures/rover_ways.png", "figures/rover_maps.png"):
        assert f"results/demo/{name}" in text


@pytest.mark.parametrize(
    ("rover", "names"),
    [
        ({"cameras": {"onboard": {"weights": "packaged"}}}, {"packaged": str(PACKAGED)}),
        ({"cameras": {"onboard": {"weights": "packaged_rover"}}}, {"packaged_rover": str(PACKAGED_ROVER)}),
        ({"cameras": {"onboard": {"weights": "own/best.pt"}}}, {"best": "own/best.pt"}),
        ({}, {"none": "None"}),
        (
            {"detector": "hapke"},
            {"hapke-seed3": "run/detect/photo/seed3/detectors/hapke.pt"},
        ),  # as for drives along a path
        (
            {"detector": "hapke", "autonomy": {"detectors": ["analog", "packaged"]}},
            {f"analog-seed{n}": f"run/detect/photo/seed{n}/detectors/analog.pt" for n in (3, 4)}
            | {"packaged": str(PACKAGED)},
        ),
        (
            {"cameras": {"onboard": {"weights": "packaged"}}, "fine_tuning": {"drives": ["other/seed0"]}},
            {"fine_tuned": "run/rover/fine_tuned.pt"},
        ),
        (
            {
                "detector": "hapke",
                "fine_tuning": {"drives": ["a"]},
                "autonomy": {"detectors": ["fine_tuned", "packaged"]},
            },
            {"fine_tuned": "run/rover/fine_tuned.pt", "packaged": str(PACKAGED)},
        ),
    ],
)
def test_detectors_by_which_the_rover_decides_have_names(rover, names):
    asked = {"run": True, "world": {"terrains": [1]}, **rover}
    config = parse_config(configured(**asked) | {"detect": {"splits": ["photo"], "seeds": [3, 4]}})
    found = config.deciding_detectors(Path("run"))
    assert {name: str(own and own.weights) for name, own in found.items()} == names


def test_a_detector_of_the_run_is_applied_as_detect_says_and_others_by_the_defaults_on_its_device():
    content = configured(run=True, world={"terrains": [1]}, autonomy={"detectors": ["packaged", "hapke"]})
    content["detect"]["prediction"] = {"mirrored": True, "device": "auto"}
    config = parse_config(content)
    own, packaged = (config.deciding_detectors(Path("run"))[name] for name in ("hapke-seed0", "packaged"))
    assert own.prediction == config.detect.prediction
    assert packaged == OnboardDetector(weights=PACKAGED, prediction=PredictionOptions(device="auto"))


def test_a_detector_is_trained_on_other_drives_before_it_looks(checkout, snakemake):
    other = checkout / "results/other/rover/seed0"
    (other / "front_end_cam").mkdir(parents=True)
    (other / "front_end_cam/poses.parquet").touch()
    tuned = {"rover": {"fine_tuning": {"drives": ["results/other/rover/seed0"]}}}
    (checkout / "config/tuned.yaml").write_text(yaml.safe_dump(tuned))
    done = snakemake(checkout, "rover", "--dry-run", "--configfile", "config/overlays/rover.yaml", "config/tuned.yaml")
    assert done.returncode == 0, done.stdout + done.stderr
    text = done.stdout + done.stderr
    jobs = planned(done)
    assert jobs["make_drive_dataset"] == jobs["fine_tune_on_drives"] == 1
    assert "train_detector" not in jobs
    assert len(re.findall(r"rule detect_drive:\n +input: .*results/demo/rover/fine_tuned\.pt", text)) == 3
    assert re.search(r"rule make_drive_dataset:\n +input: results/other/rover/seed0/front_end_cam/poses\.parquet", text)


@pytest.mark.parametrize(
    ("rover", "key"),
    [
        ({"run": True}, "rover.world.terrains"),
        ({"run": True, "world": {"terrains": [1]}, "detector": "lambert"}, "rover.detector"),
        ({"run": True, "world": {"terrains": [1]}, "bag": {"sun": "7"}}, "bag.sun"),
        ({"run": True, "world": {"terrains": [1]}, "autonomy": {"detectors": ["lambert"]}}, "rover.autonomy.detectors"),
        ({"autonomy": {"headlights": ["navlight_left"]}}, "rover.autonomy.headlights"),
        ({"cameras": {"lights": ["navlight_left"] * 2}}, "rover.cameras.lights"),
        ({"seeds": [1, 1]}, "rover.seeds"),
        ({"wheels": 4}, "rover.wheels"),
    ],
)
def test_an_impossible_drive_ends_in_an_error_that_names_the_key(rover, key):
    with pytest.raises(ConfigError, match=re.escape(key)):
        parse_config(configured(**rover))


def test_runs_without_drives_have_no_rover_tables():
    plain = parse_config(yaml.safe_load(DEMO.read_text())).digest()
    assert parse_config(configured(seeds=[3])).digest() == plain
    drives = {"run": True, "world": {"terrains": [1]}}
    assert parse_config(configured(**drives)).digest() != plain


DRAWN = ("rover_sequence", "rover_front", "rover_drive")
OF_A_DRIVE = (
    "drive_rover",
    "read_sensors",
    "render_drive",
    "localise_drive",
    "measure_drive",
    "write_bag",
    "drive_alone",
)
OF_ALL = ("summarise_drives", "summarise_onboard", "draw_drive", "summarise_autonomy")


@pytest.mark.slow
def test_drives_end_in_tables_figures_and_a_bag_and_one_more_seed_keeps_finished_drives(checkout, snakemake):
    pytest.importorskip("mujoco", reason="mujoco is not installed")
    pytest.importorskip("mcap_ros2", reason="mcap-ros2-support is not installed")
    write_meshes(checkout / "results/small/meshes/Terrain03", 3)

    def run(seeds: list[int], *options: str) -> subprocess.CompletedProcess:
        autonomy = {"run": True, "modes": ["blind"], "longest_s": 1}
        content = configured(**SMALL, seeds=seeds, autonomy=autonomy) | {"run": "small", "terrains": [3]}
        (checkout / "config/small.yaml").write_text(yaml.safe_dump(content))
        # The call excludes the rules of meshes and writes only missing files.
        targets = ("rover", "results/small/rover/autonomy.parquet")
        allowed = ("--allowed-rules", "rover", "cut_rocks", "write_urdf", "draw_front", *OF_A_DRIVE, *OF_ALL)
        done = snakemake(checkout, *targets, "--configfile", "config/small.yaml", *options, *allowed)
        assert done.returncode == 0, done.stderr[-3000:]
        return done

    run([0])
    results = checkout / "results/small"
    drive = results / "rover/seed0"
    assert json.loads((drive / "drive.json").read_text())["seconds"] == 5
    assert len(list((drive / "front_end_cam/3_hapke_0256").glob("*.png"))) == 6
    each = pd.read_parquet(results / "tables/rover_drives.parquet")
    assert each["duration s"].item() == 5
    assert each["energy missing %"].item() < 2
    assert each["ended"].item() == "out of time"  # the time limit was reached
    for name in ("rover", "rover_drives", "rover_onboard", "rover_autonomy"):
        for form in ("csv", "md", "tex", "parquet"):
            assert (results / f"tables/{name}.{form}").stat().st_size
    for name in DRAWN:
        assert (results / f"figures/{name}.png").stat().st_size
    table = pd.read_parquet(results / "rover/autonomy.parquet").set_index("metric")
    assert table.loc["time", ["mode", "sun", "drives", "value"]].tolist() == ["blind", "any", 1, 1.0]

    from mcap.reader import make_reader

    with (drive / "drive.mcap").open("rb") as file:
        summary = make_reader(file).get_summary()
    topics = {
        channel.topic: summary.statistics.channel_message_counts[number] for number, channel in summary.channels.items()
    }
    assert topics["/front_end_cam/image/compressed"] == 6
    assert topics["/odom"] == 251
    assert "Nothing to be done" in run([0], "--dry-run").stdout
    jobs = planned(run([0, 1], "--dry-run"))
    assert jobs == dict.fromkeys((*OF_A_DRIVE, *OF_ALL, "rover"), 1) | {"total": len(OF_A_DRIVE) + len(OF_ALL) + 1}


def test_the_rover_takes_a_finished_demo_as_it_is():
    """Configurations of the rover are overlays of the demo, so stages of the demo are not repeated."""
    demo = read_configs([DEMO])
    files = [DEMO.parent / "overlays" / name for name in ("rover.yaml", "rover_autonomy.yaml")]
    rover = read_configs(files)
    assert rover.model_copy(update={"rover": demo.rover}) == demo
