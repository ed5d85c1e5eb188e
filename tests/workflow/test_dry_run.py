"""Plans of all configurations; an invalid configuration is an error of one line."""

import re
import shutil
from pathlib import Path

import pytest
import yaml

from polarsim import config
from tests.workflow.conftest import jobs_with, planned

CONFIGURATIONS = Path(__file__).parents[2] / "config"
DEMO = ("--configfile", "config/config.yaml")
STAGES = ("acquire", "cameras", "rocks", "labels", "render", "detect", "tables", "publish")


@pytest.fixture(scope="module")
def release_like(tmp_path_factory) -> Path:
    """A folder with one label file and no mesh for each terrain."""
    root = tmp_path_factory.mktemp("release")
    for terrain in range(1, 14):
        folder = root / "Labels" / f"Terrain{terrain:02d}"
        folder.mkdir(parents=True)
        (folder / f"{terrain:02d}_A_off_30_L_0256.txt").write_text("0 0.5 0.5 0.1 0.1\n")
    return root


@pytest.mark.parametrize("name", ["config", "full", "release", "paper"])
def test_every_configuration_plans_its_jobs(dry_run, release_like, name):
    root = {} if name in ("config", "full") else {"POLAR_SIM_ROOT": str(release_like)}
    done = dry_run("--configfile", f"config/{name}.yaml", **root)
    jobs = planned(done)
    stages = {"index_terrain", "locate_cameras", "propagate_labels", "render_twins", "draw_photos"}
    assert stages | {"tabulate_evaluation", "score_labels", "report_label_scores"} <= set(jobs)
    assert ("train_detector" in jobs) == (name not in ("full", "release"))  # the release has no photos


def test_the_papers_protocol_trains_each_domain_by_two_splits_with_three_seeds(dry_run, release_like):
    done = dry_run("--configfile", "config/paper.yaml", POLAR_SIM_ROOT=str(release_like))
    jobs = planned(done)
    assert (jobs["convert_pictures"], jobs["make_dataset"], jobs["split_photos"]) == (3, 6, 2)
    assert jobs["train_detector"] == jobs["predict"] == 3 * 2 * 3
    assert jobs["evaluate"] == 2 * 3
    assert jobs["total"] < 1000


def test_mixes_and_novel_views_are_trained_on_and_not_tested_on(checkout, snakemake):
    (checkout / "views").mkdir()
    (checkout / "views/index.csv").write_text("name,scene,camera,exposure_ms\n")
    detect = "{views: views, mixes: {mixed: {analog: 0.5, views: 2}}, splits: [position]}"
    done = snakemake(checkout, "detect", "--dry-run", "--config", f"detect={detect}")
    jobs = planned(done)
    counts = [jobs[name] for name in ("train_detector", "mix_datasets", "make_dataset", "convert_pictures")]
    assert counts == [5, 1, 4, 4]
    text = done.stdout + done.stderr
    assert "detect/position/seed0/predictions/mixed_on_analog.parquet" in text
    assert "_on_mixed" not in text
    assert "_on_views" not in text


def test_the_demo_trains_a_yolo_only_on_photos(dry_run):
    done = dry_run(*DEMO)
    jobs, text = planned(done), done.stdout + done.stderr
    assert [jobs[name] for name in ("train_other_detector", "predict_by_other", "evaluate_other")] == [1, 1, 1]
    assert "others/yolo/seed0/predictions/analog_on_hapke.parquet" in text
    assert "others/yolo/seed0/predictions/hapke_on_analog.parquet" not in text


def test_an_overlay_adds_a_yolo_detector_to_the_demo(dry_run):
    done = dry_run("detect", "tables", "--configfile", "config/config.yaml", "config/overlays/yolo.yaml")
    jobs = planned(done)
    own = ("train_detector", "predict", "evaluate")
    others = ("train_other_detector", "predict_by_other", "evaluate_other")
    assert [jobs[name] for name in own] == [jobs[name] for name in others] == [3, 3, 1]
    assert jobs["gather_others"] == 1
    text = done.stdout + done.stderr
    assert "others/yolo/seed0/predictions/hapke_on_analog.parquet" in text
    (table,) = re.findall(r"rule report_detectors:\n +input: (.*)", text)
    assert "detect/others.parquet" in table


def test_stages_are_targets_and_options_add_jobs_and_inputs(dry_run, tmp_path):
    edited = tmp_path / "edited" / "01_A_off_30_L_0256.txt"
    edited.parent.mkdir()
    edited.write_text("0 0.5 0.5 0.1 0.1\n")
    render = "render={maps: [depth, shading], materials_from_photos: true}"
    changed = (render, f"labels={{corrections: {edited.parent}}}", "publish={forms: [coco, pds4, usd]}")
    done, demo = dry_run(*STAGES, "--config", *changed), dry_run(*DEMO)
    jobs, text = planned(done), done.stdout + done.stderr
    assert set(STAGES) <= set(jobs)
    assert text.count("renders/maps/Terrain") == 3
    assert jobs["fit_materials"] == jobs["score_materials"] == 3  # one per terrain, with ground truth
    assert jobs["fit_light"] == 1  # the lamps of all terrains
    assert (jobs["publish"], jobs["publish_run"]) == (1, 3)
    (user,) = jobs_with(text, str(edited))
    assert user.startswith("rule propagate_labels:")
    assert "Terrain01" in user
    assert "renders/maps/Terrain" not in demo.stdout + demo.stderr
    assert not {"fit_light", "fit_materials", "score_materials", "publish_run"} & set(planned(demo))


def test_figures_of_twins_read_the_twins_of_models_without_detectors(dry_run):
    config = ("render={models: [principled, hapke, fitted]}", "detect={run: false}")
    done = dry_run("results/demo/figures/opposition.png", *DEMO, "--config", *config)
    (pictures,) = re.findall(r"rule draw_opposition:\n +input: (.*)", done.stdout + done.stderr)
    assert pictures.count("renders/fitted/Terrain") == pictures.count("renders/hapke/Terrain") == 3


def test_the_ablation_renders_every_component_per_terrain_and_trains_two_detectors(dry_run):
    files = ("--configfile", "config/config.yaml", "config/overlays/gap.yaml")
    done = dry_run("gap", *files)
    jobs, text = planned(done), done.stdout + done.stderr
    components = yaml.safe_load((CONFIGURATIONS / "overlays/gap.yaml").read_text())["gap"]["components"]
    pictured = [name for name in components if name != "labels"]
    assert jobs["render_component"] == 3 * len(pictured)
    assert jobs["predict_component"] == 2 * len(pictured)
    assert (jobs["train_detector"], jobs["write_truth"], jobs["fit_materials"]) == (2, 3, 3)
    users = [job for job in jobs_with(text, "gap/truth") if "gap/truth" in job.split("output:")[0]]
    assert {job.split(":")[0].split()[-1] for job in users} == {"render_component"}
    for name in pictured:
        assert f"gap/twins/{name}/pictures/Terrain03" in text


def test_an_overlay_adds_the_split_of_the_paper(dry_run):
    files = ("--configfile", "config/config.yaml", "config/overlays/strict.yaml")
    done = dry_run("detect", "tables", *files)
    jobs = planned(done)
    assert (jobs["train_detector"], jobs["measure_stereo"]) == (2 * 3, 3)
    assert jobs["split_photos"] == 2


def test_accuracy_is_measured_without_labels_and_twins(dry_run):
    done = dry_run("geometry", "--configfile", "config/accuracy.yaml")
    jobs = planned(done)
    assert {"refine_cameras", "mesh_rocks", "score_geometry", "tabulate_geometry"} <= set(jobs)
    assert not {"propagate_labels", "render_twins", "train_detector"} & set(jobs)


def test_thirteen_terrains_plan_fewer_than_1000_jobs(checkout, snakemake):
    content = yaml.safe_load((checkout / "config/config.yaml").read_text())
    content.update(terrains=list(range(1, 14)), positions=list("ABCDEFG"), grid={})
    content["detect"] |= {"splits": ["photo", "terrain"], "seeds": [0, 1, 2]}
    (checkout / "config/all.yaml").write_text(yaml.safe_dump(content))
    done = snakemake(checkout, "--dry-run", "--configfile", "config/all.yaml")
    assert planned(done)["total"] < 1000


@pytest.mark.parametrize(
    ("text", "named"),
    [
        ("labels: {min_contrast_dn: 20}\nlabels: {corrections: null}\n", "labels"),
        ("labels: {excluded_annotations: [04_A_off_30_L_0256]}\n", "04_A_off_30_L_0256"),
    ],
)
def test_values_that_snakemake_accepts_silently_are_an_error_before_any_job(checkout, snakemake, text, named):
    (checkout / "config/mine.yaml").write_text(text)
    done = snakemake(checkout, "--dry-run", "--configfile", "config/config.yaml", "config/mine.yaml")
    lines = [line for line in done.stderr.splitlines() if line.startswith("error:")]
    assert (done.returncode, len(lines)) == (1, 1)
    assert named in lines[0]
    assert "Traceback" not in done.stderr


def test_the_schema_is_the_configurations():
    assert (CONFIGURATIONS / "schema.json").read_text() == config.config_schema(), "run make schema"


@pytest.fixture(scope="module")
def release_with_covers(release_like, tmp_path_factory) -> Path:
    """A release with cover photos of all terrains except 11 and rocks of all terrains except 12."""
    root = tmp_path_factory.mktemp("covers") / "release"
    shutil.copytree(release_like, root)
    for terrain in (1, 3, 4, 8, 11, 12):
        photo = root / "CoverPhotoOfIndices" / f"cover_photo_indexed_{terrain:02d}_A.png"
        rock = root / "TerrainMeshes" / f"Terrain{terrain:02d}" / f"terrain{terrain:02d}_rock1.obj"
        for path in ([photo] if terrain != 11 else []) + ([rock] if terrain != 12 else []):
            path.parent.mkdir(parents=True, exist_ok=True)
            path.touch()
    return root


@pytest.mark.parametrize("models", [("principled", "hapke"), ("hapke",)], ids=" ".join)
def test_tables_of_real_photos_have_a_detector_of_each_domain_fold_and_seed(dry_run, release_with_covers, models):
    files = ("--configfile", "config/real_tables.yaml", "--config", f"render={{models: [{', '.join(models)}]}}")
    done = dry_run("real_tables", *files, POLAR_SIM_ROOT=str(release_with_covers))
    jobs, domains = planned(done), 1 + len(models)
    assert jobs["cut_domain_windows"] == domains + 1  # and the control
    assert jobs["make_twin_dataset"] == 2 * (domains + 1)  # folds
    assert jobs["train_domain_detector"] == jobs["predict_domains"] == 2 * 2 * domains  # folds and seeds
    assert jobs["train_cover_detector"] == 1  # carved rocks, the start of all detectors
    assert (jobs["pair_covers_with_twins"], jobs["compare_domains"], jobs["report_real_tables"]) == (1, 2, 1)
    assert jobs["invent_relief"] == jobs["render_control"] == 6  # terrains
    for domain in ("real", *models):
        (job,) = jobs_with(done.stdout + done.stderr, f"folds/03_04_11/seed1/domains/{domain}.csv")
        assert f"folds/03_04_11/domains/{domain}" in job
        assert "folds/carved/seed0/rendered/detector.pt" in job


@pytest.mark.parametrize("target", ["real_tables", "cover_photos"])
def test_a_target_of_cover_photos_needs_cover_photos_when_it_is_planned(dry_run, target):
    done = dry_run(target, "--configfile", "config/config.yaml")
    assert done.returncode == 1
    errors = [line for line in done.stderr.splitlines() if line.startswith("error: ")]
    assert len(errors) == 1
    assert "CoverPhotoOfIndices" in errors[0]
    assert "Traceback" not in done.stderr


@pytest.fixture(scope="module")
def unannotated(tmp_path_factory) -> tuple[str, ...]:
    """Options of a run with photos of a terrain and seeds in a folder, without reference labels, detectors, drives."""
    seeds = tmp_path_factory.mktemp("seeds")
    (seeds / "01_A_off_30_L_0256.txt").write_text("0 0.5 0.5 0.1 0.1\n")
    values = ["terrains=[1]", f"labels={{seeds: {{root: {seeds}}}}}", "detect={run: false}"]
    return ("--configfile", "config/polar.yaml", "--config", *values)


@pytest.mark.parametrize(
    ("table", "key"),
    [
        ("labels", "scoring.annotated_root"),
        ("detection", "detect.run"),
        ("ipd_rocks", "detect.run"),
        ("elsewhere", "detect.elsewhere"),
        ("masks", "detect.training.masks"),
        ("rover", "rover.run"),
        ("rover_onboard", "rover.run"),
        ("rover_autonomy", "rover.autonomy.run"),
    ],
)
def test_a_table_without_inputs_is_an_error_of_the_plan_that_names_the_key(dry_run, unannotated, table, key):
    done = dry_run(f"results/polar/tables/{table}.csv", *unannotated)
    assert done.returncode == 1
    (line,) = [line for line in done.stderr.splitlines() if line.startswith("error: ")]
    assert key in line
    assert "Traceback" not in done.stderr


@pytest.mark.parametrize("file", ["labels_Terrain01.csv", "outlines_Terrain01.csv", "materials_Terrain01.csv"])
def test_no_terrain_is_compared_with_a_missing_reference(dry_run, unannotated, file):
    done = dry_run(f"results/polar/evaluation/{file}", *unannotated)
    assert done.returncode != 0
    assert "No rule to produce" in done.stdout + done.stderr


def test_a_run_without_reference_labels_has_all_other_tables(dry_run, unannotated):
    jobs = planned(dry_run("tables", *unannotated))
    assert {"tabulate_evaluation", "tabulate_geometry", "report_rock_sizes"} <= set(jobs)
    assert not {"report_label_scores", "score_labels", "report_detectors"} & set(jobs)


def test_twins_before_a_fit_are_rendered_on_the_ground_before_it_was_refined(dry_run, release_with_covers):
    files = ("--configfile", "config/release.yaml", "--config")
    refined = dry_run(
        "before_after", *files, "rocks={ground_from_photos: true}", POLAR_SIM_ROOT=str(release_with_covers)
    )
    jobs = planned(refined)
    assert jobs["render_unrefined"] == jobs["refine_ground"] == jobs["render_twins"]
    fitted = dry_run(
        "before_after", *files, "render={models: [principled, fitted]}", POLAR_SIM_ROOT=str(release_with_covers)
    )
    assert planned(fitted)["draw_before_after"] == 1
    assert "render_unrefined" not in planned(fitted)
    nothing = dry_run("before_after", "--configfile", "config/config.yaml")
    assert nothing.returncode == 1
    assert sum(line.startswith("error: ") for line in nothing.stderr.splitlines()) == 1


def test_tables_of_real_photos_are_not_part_of_a_complete_run(dry_run, release_with_covers):
    jobs = planned(dry_run("--configfile", "config/release.yaml", POLAR_SIM_ROOT=str(release_with_covers)))
    assert "pair_covers_with_twins" not in jobs


def test_each_terrain_with_cover_photos_is_left_out_in_turn(dry_run, release_with_covers):
    done = dry_run(
        "cover_photos", "--configfile", "config/covers.yaml", "--config", "covers={folds: []}", "detect={seeds: [0]}",
        POLAR_SIM_ROOT=str(release_with_covers),
    )  # fmt: skip
    jobs = planned(done)
    assert jobs["render_scenes"] == 5 + 1  # terrain 12 has no rocks; + carved rocks
    assert jobs["predict_cover_photos"] == 5 * 2  # terrain 11 is not tested; before and after fine-tuning
    assert jobs["train_cover_detector"] == jobs["make_cover_dataset"] == 5 + 2  # + carved rocks, + all terrains
    assert jobs["fine_tune_cover_detector"] == jobs["make_fine_tuning_dataset"] == 5 + 1
    assert (jobs["read_covers"], jobs["cut_windows"], jobs["score_covers"], jobs["write_results_page"]) == (1, 1, 2, 1)
    text = done.stdout + done.stderr
    for fold in ("01", "03", "04", "08", "12"):
        job = next(part for part in re.split(r"\nrule |\nlocalrule ", text) if f"make_cover_dataset_{fold}.log" in part)
        assert {found[-2:] for found in re.findall(r"scenes/Terrain\d\d", job)} == {"01", "03", "04", "08", "11"} - {
            fold
        }


def test_ground_from_photos_is_read_by_all_stages_after_the_cameras(checkout, snakemake, release_with_covers):
    """The refined ground depends on the refined cameras, which depend on the unrefined ground."""
    done = snakemake(
        checkout,
        "results/release/renders/labels.parquet",
        "--dry-run",
        "--configfile",
        "config/release.yaml",
        "--config",
        "rocks={ground_from_photos: true}",
        POLAR_SIM_ROOT=str(release_with_covers),
    )
    assert done.returncode == 0, done.stderr[-3000:]
    jobs = planned(done)
    assert jobs["refine_ground"] == jobs["adopt_rocks"] == jobs["refine_cameras"] == jobs["render_twins"]
