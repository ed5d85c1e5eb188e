import json
import re
import subprocess
import sys
from pathlib import Path

import pytest

from polarsim.config import MOVED, Config, parse_config, render_options
from polarsim.errors import ConfigError
from polarsim.render.options import RenderOptions


def test_no_assignment_leaves_the_defaults():
    assert render_options([]) == RenderOptions()


def test_assignments_reach_any_depth_and_the_last_one_wins():
    found = render_options(["samples=9", "samples=4", "blur_px=0.6", "principled.roughness=0.5", "gain={hapke: 150}"])
    expected = {"samples": 4, "blur_px": 0.6, "principled": {"roughness": 0.5}, "gain": {"hapke": 150}}
    assert found == RenderOptions.model_validate(expected)
    assert render_options(["hapke.w=0.3", "hapke.b=0.2", "hapke.c=0.1"]).hapke.b == 0.2


@pytest.mark.parametrize(
    ("assignment", "told"),
    [
        ("samples", "'samples' is no option: expected KEY=VALUE"),
        ("=4", "'=4' is no option: expected KEY=VALUE"),
        ("samples=5", "samples: should be 1, 4, 9 or 16, found 5"),
        ("blurr_px=1", "blurr_px: unknown key"),
        ("blur_px=wide", "blur_px: .*number.*found 'wide'"),
        ("gain={", "gain: '{' is no YAML value"),
        ("principled.shine=1", "principled.shine: unknown key"),
        ("pixel_filter=gaussian", "pixel_filter: gaussian needs samples"),
    ],
)
def test_a_wrong_assignment_is_told_in_one_line(assignment, told):
    with pytest.raises(ConfigError, match=told) as error:
        render_options([assignment])
    assert "\n" not in str(error.value)


def detect(**options):
    source = {"kind": "analog", "root": "data"}
    return parse_config({"source": source, "detect": options})


@pytest.mark.parametrize(
    ("section", "told"),
    [
        ({"imgsz": 96}, "detect.imgsz is now detect.pictures.imgsz"),
        ({"seed": 1}, "detect.seed is now detect.split.seed and detect.comparison.seed"),
        (
            {"epochs": 1, "tone": "fixed"},
            "detect.tone is now detect.pictures.tone; detect.epochs is now detect.training",
        ),
    ],
)
def test_a_key_that_moved_is_refused_with_its_new_place(section, told):
    with pytest.raises(ConfigError, match=told):
        detect(**section)


@pytest.mark.parametrize("key", ["cameras.localisation.edge_sd_px", "rover.drive.stuck_s", "tables.figure_width_px"])
def test_a_key_that_is_a_constant_now_is_refused_by_name(key):
    section, *path, last = key.split(".")
    content = {last: 1}
    for name in reversed(path):
        content = {name: content}
    with pytest.raises(ConfigError, match=rf"(^|; ){re.escape(key if section != 'tables' else 'tables')}: unknown key"):
        parse_config({"source": {"kind": "analog", "root": "data"}, section: content})


def test_every_moved_key_has_a_place_and_none_at_its_old_one():
    for old, points in MOVED.items():
        assert not describes(old)
        assert all(describes(new) for new in points.split(" and "))


@pytest.mark.parametrize("name", ["schema.json", "views.schema.json"])
def test_every_key_and_section_is_described_by_a_sentence(name):
    schema = json.loads((Path(__file__).parents[1] / "config" / name).read_text())
    sections = schema["$defs"] | {schema["title"]: schema}
    texts = {title: section.get("description", "") for title, section in sections.items()}
    for title, section in sections.items():
        for key, about in section["properties"].items():
            of_its_section = texts.get(about.get("$ref", "").split("/")[-1], "")
            texts[f"{title}.{key}"] = about.get("description", of_its_section)
    assert [key for key, text in texts.items() if len(text.split()) < 4 or not text.endswith(".")] == []


def describes(key):
    """Whether the schema of a configuration has a key."""
    model = Config
    for part in key.split("."):
        if part not in model.model_fields:
            return False
        model = model.model_fields[part].annotation
    return True


def test_detectors_are_trained_on_mixes_and_views_and_compared_over_domains_alone():
    found = detect(views="results/views", mixes={"mixed": {"analog": 1, "views": 0.5}})
    assert found.domains == ("analog", "principled", "hapke")
    assert found.training_domains == ("analog", "principled", "hapke", "views", "mixed")


def test_a_run_without_detectors_compares_no_domains_whatever_else_stands_in_that_section():
    found = detect(run=False, views="results/views", mixes={"mixed": {"analog": 1}}, stereo={"run": True})
    assert found.domains == found.training_domains == ()
    assert found.photo_domain == "analog"


def test_a_further_detector_is_trained_on_domains_that_are_there():
    assert detect(others={"yolo": {"trained_on": ["hapke"]}}).detect.others["yolo"].trained_on == ("hapke",)
    with pytest.raises(ConfigError, match=r"detect\.others\.yolo\.trained_on: 'real', expected analog, principled"):
        detect(others={"yolo": {"trained_on": ["real"]}})


def ablation(component, kind="analog", **gap):
    gap = {"components": {"one": component}, **gap}
    return parse_config({"source": {"kind": kind, "root": "data"}, "gap": gap})


def test_a_component_changes_its_own_options_and_no_others():
    found = ablation({"render": {"noise": True}})
    assert found.render_options_of("one") == found.render.model_copy(update={"noise": True, "models": ("hapke",)})
    assert found.ablation_detectors == ("analog", "hapke")
    assert ablation({"labels": "propagated"}, trained_on=["principled"]).ablation_detectors == ("principled",)


@pytest.mark.parametrize(
    ("component", "gap", "told"),
    [
        ({"cameras": "truth"}, {"kind": "polar"}, "gap.components.one: truth is known of the analog alone"),
        ({"render": {"nose": True}}, {}, "gap.components.one.render.nose: unknown key"),
        ({"render": {"samples": 5}}, {}, "gap.components.one.render.samples"),
        ({"materials": "fitted", "meshes": "thinned"}, {}, "materials are fitted to the run's meshes"),
        ({"labels": "propagated"}, {"model": "lambert"}, "gap.model: lambert has no twins"),
        ({"labels": "propagated"}, {"trained_on": ["real"]}, "gap.trained_on: 'real', expected analog"),
        ({}, {}, "replaces nothing"),
    ],
)
def test_an_impossible_ablation_is_told(component, gap, told):
    with pytest.raises(ConfigError, match=told) as error:
        ablation(component, **gap)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    ("setting", "named"),
    [
        ({"terains": [1]}, "terains: unknown key"),
        ({"terrains": [14]}, "terrains: terrain 14, expected 1 to 13"),
        ({"positions": ["H"]}, "positions: position 'H', expected A to G"),
        ({"detect": {"splits": ["rock"]}}, "detect.splits"),
        ({"grid": {"lights": [True]}}, "grid.lights"),
        ({"source": {"kind": "moon"}}, "source.kind"),
        ({"run": "../elsewhere"}, "run"),
    ],
)
def test_an_impossible_setting_is_named(setting, named):
    with pytest.raises(ConfigError, match=named) as error:
        parse_config({"source": {"kind": "analog", "root": "data"}, **setting})
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    ("mixes", "told"),
    [
        ({"mixed": {"real": 1}}, "detect.mixes.mixed: domain 'real', expected analog, hapke, principled"),
        ({"mixed": {"views": 1}}, "detect.mixes.mixed: domain 'views'"),
        ({"hapke": {"analog": 1}}, "hapke is a domain, a mix needs a name of its own"),
        ({"views": {"analog": 1}}, "views is a domain, a mix needs a name of its own"),
        ({"one": {"analog": 1}, "two": {"one": 1}}, "detect.mixes.two: domain 'one'"),
    ],
)
def test_a_mix_of_what_is_not_there_is_told(mixes, told):
    with pytest.raises(ConfigError, match=told):
        detect(mixes=mixes)


def seeded(seeds, kind="polar", **others):
    return parse_config({"source": {"kind": kind, "root": "data"}, "labels": {"seeds": seeds}, **others})


def test_a_run_may_have_no_seeds():
    found = seeded("none")
    assert found.labels.seeds == "none"
    assert "seeds" not in found.labels.stage_options()
    assert parse_config(found.model_dump(mode="json")).digest() == found.digest() != seeded({}).digest()


@pytest.mark.parametrize(
    ("seeds", "kind", "told"),
    [
        ("none", "release", "labels.seeds: none needs scans: the release has none"),
        ("no", "polar", "labels.seeds: 'no', expected options of seeds or 'none'"),
        (None, "polar", "labels.seeds: None, expected options of seeds or 'none'"),
        ({"azimuth": 30}, "polar", "labels.seeds.azimuth: unknown key"),
        ({"camera": "M"}, "polar", "labels.seeds.camera"),
    ],
)
def test_impossible_seeds_are_told_in_one_line(seeds, kind, told):
    with pytest.raises(ConfigError, match=told) as error:
        seeded(seeds, kind)
    assert "\n" not in str(error.value)


def test_scores_are_measured_against_the_folder_that_is_named_or_that_of_the_seeds():
    assert seeded("none").annotated_root == Path("data")
    assert seeded({"root": "annotated"}).annotated_root == Path("annotated")
    assert seeded("none", scoring={"annotated_root": "annotated"}).annotated_root == Path("annotated")


def test_every_start_of_snakemake_reads_the_configuration_without_heavy_libraries():
    script = "import sys; import polarsim.config, polarsim.acquire.inputs; print(*sys.modules)"
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    assert "polarsim.config" in done.stdout.split()
    assert not {"matplotlib", "numba", "pandas", "scipy", "torch"} & set(done.stdout.split())


@pytest.mark.parametrize("value", [float("inf"), float("-inf"), float("nan")])
@pytest.mark.parametrize("key", ["labels.min_rock_px", "rocks.rock_cell_mm", "detect.mixes.mixed.analog"])
def test_a_number_that_is_not_finite_is_an_error_with_its_key(key, value):
    content = value
    for name in reversed(key.split(".")):
        content = {name: content}
    with pytest.raises(ConfigError) as caught:
        parse_config({"source": {"kind": "analog"}, **content})
    assert key in caught.value.reason
