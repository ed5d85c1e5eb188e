import json
import re
from pathlib import Path

import pytest

from polarsim.config import parse_config, render_options
from polarsim.errors import ConfigError
from polarsim.render.options import RenderOptions


def test_assignments_reach_any_depth_and_the_last_one_wins():
    found = render_options(
        ["samples=9", "samples=4", "blur_px=0.6", "materials.default.principled.roughness=0.5", "gain={hapke: 150}"]
    )
    expected = {
        "samples": 4,
        "blur_px": 0.6,
        "materials": {"default": {"principled": {"roughness": 0.5}}},
        "gain": {"hapke": 150},
    }
    assert found == RenderOptions.model_validate(expected)
    given = [f"materials.default.hapke.{key}" for key in ("w=0.3", "b=0.2", "c=0.1")]
    assert render_options(given).parameters("hapke").b == 0.2


@pytest.mark.parametrize(
    ("assignment", "named"),
    [
        ("samples", "'samples'"),
        ("=4", "'=4'"),
        ("samples=5", "samples:"),
        ("blurr_px=1", "blurr_px:"),
        ("blur_px=wide", "blur_px:"),
        ("gain={", "gain:"),
        ("materials.default.principled.shine=1", "materials.default.principled.shine:"),
    ],
)
def test_a_wrong_assignment_is_an_error(assignment, named):
    with pytest.raises(ConfigError, match=re.escape(named)) as error:
        render_options([assignment])
    assert "\n" not in str(error.value)


def detect(**options):
    source = {"kind": "analog", "root": "data"}
    return parse_config({"source": source, "detect": options})


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


def test_detectors_are_trained_on_mixes_and_views_and_compared_over_domains():
    found = detect(views="results/views", mixes={"mixed": {"analog": 1, "views": 0.5}})
    assert found.domains == ("analog", "principled", "hapke")
    assert found.training_domains == ("analog", "principled", "hapke", "views", "mixed")


def test_a_run_without_detectors_compares_no_domains():
    found = detect(run=False, views="results/views", mixes={"mixed": {"analog": 1}}, stereo={"run": True})
    assert found.domains == found.training_domains == ()
    assert found.photo_domain == "analog"


def test_a_further_detector_is_trained_on_domains_that_are_there():
    assert detect(others={"yolo": {"trained_on": ["hapke"]}}).detect.others["yolo"].trained_on == ("hapke",)


def test_no_detector_is_trained_on_fitted_twins():
    found = parse_config(
        {"source": {"kind": "analog", "root": "data"}, "render": {"models": ["principled", "hapke", "fitted"]}}
    )
    assert found.domains == found.training_domains == ("analog", "principled", "hapke")
    assert (found.ablation_model, found.domains_to_fit) == ("hapke", ("fitted",))


def test_a_component_changes_only_the_named_options():
    gap = {"components": {"one": {"render": {"noise": True}}}}
    found = parse_config({"source": {"kind": "analog", "root": "data"}, "gap": gap})
    assert found.render_options_of("one") == found.render.model_copy(update={"noise": True, "models": ("hapke",)})
    assert found.ablation_detectors == ("analog", "hapke")


POLAR, RELEASE = ({"source": {"kind": kind, "root": "data"}} for kind in ("files", "release"))


def component(**options):
    return {"gap": {"components": {"one": options}}}


def mixes(**weights):
    return {"detect": {"mixes": weights}}


@pytest.mark.parametrize(
    ("setting", "named"),
    [
        ({"terains": [1]}, "terains:"),
        ({"terrains": [14]}, "terrains.0:"),
        ({"positions": ["H"]}, "positions:"),
        ({"detect": {"splits": ["rock"]}}, "detect.splits"),
        ({"detect": {"others": {"yolo": {"trained_on": ["real"]}}}}, "detect.others.yolo.trained_on:"),
        ({"grid": {"lights": [True]}}, "grid.lights"),
        ({"source": {"kind": "moon"}}, "source.kind"),
        ({"run": "../elsewhere"}, "run"),
        ({"terrains": [1], "covers": {"run": True, "folds": [[1, 2]]}}, "covers.folds: 2"),
        (POLAR | component(cameras="truth"), "gap.components.one:"),
        (component(render={"nose": True}), "gap.components.one.render.nose:"),
        (component(render={"samples": 5}), "gap.components.one.render.samples"),
        (component(materials="fitted", meshes="thinned"), "gap.components.one:"),
        (component(), "gap.components.one"),
        (mixes(mixed={"real": 1}), "detect.mixes.mixed:"),
        (mixes(mixed={"views": 1}), "detect.mixes.mixed:"),
        (mixes(hapke={"analog": 1}), "detect.mixes:"),
        (mixes(views={"analog": 1}), "detect.mixes:"),
        (mixes(one={"analog": 1}, two={"one": 1}), "detect.mixes.two:"),
        (RELEASE | {"labels": {"seeds": "none"}}, "labels.seeds:"),
        (POLAR | {"source": POLAR["source"] | {"scans": False}, "labels": {"seeds": "none"}}, "labels.seeds:"),
        (RELEASE | {"source": RELEASE["source"] | {"scans": False}}, "source: scans"),
        (POLAR | {"labels": {"seeds": "no"}}, "labels.seeds:"),
        (POLAR | {"labels": {"seeds": None}}, "labels.seeds:"),
        (POLAR | {"labels": {"seeds": {"azimuth": 30}}}, "labels.seeds.azimuth:"),
        (POLAR | {"labels": {"seeds": {"camera": "M"}}}, "labels.seeds.camera"),
        (POLAR | {"labels": {"seeds": {"azimuths": [90]}}}, "labels.seeds.azimuths:"),
        (POLAR | {"labels": {"seeds": {"exposure": 300}}}, "labels.seeds.exposure:"),
    ],
)
def test_an_impossible_setting_is_named_in_one_line(setting, named):
    with pytest.raises(ConfigError, match=re.escape(named)) as error:
        parse_config({"source": {"kind": "analog", "root": "data"}, **setting})
    assert "\n" not in str(error.value)


def seeded(seeds, **others):
    return parse_config(POLAR | {"labels": {"seeds": seeds}, **others})


def test_a_run_may_have_no_seeds():
    found = seeded("none")
    assert found.labels.seeds == "none"
    assert "seeds" not in found.labels.stage_options()
    assert parse_config(found.model_dump(mode="json")).digest() == found.digest() != seeded({}).digest()


def test_scores_are_measured_against_the_folder_that_is_named_or_that_of_the_seeds():
    assert seeded("none").annotated_root == Path("data")
    assert seeded({"root": "annotated"}).annotated_root == Path("annotated")
    assert seeded("none", scoring={"annotated_root": "annotated"}).annotated_root == Path("annotated")


@pytest.mark.parametrize("value", [float("inf"), float("-inf"), float("nan")])
@pytest.mark.parametrize("key", ["labels.min_rock_side_px", "rocks.rock_cell_mm", "detect.mixes.mixed.analog"])
def test_a_number_that_is_not_finite_is_an_error_with_its_key(key, value):
    content = value
    for name in reversed(key.split(".")):
        content = {name: content}
    with pytest.raises(ConfigError) as caught:
        parse_config({"source": {"kind": "analog"}, **content})
    assert key in caught.value.reason


CHECKOUT = Path(__file__).parents[1]


def leaves(schema: dict, node: dict, key: tuple[str, ...] = (), seen: tuple[str, ...] = ()) -> set[tuple[str, ...]]:
    """Return the leaves of a JSON schema, without user-defined keys."""
    if "$ref" in node:
        name = node["$ref"].split("/")[-1]
        return {key} if name in seen else leaves(schema, schema["$defs"][name], key, (*seen, name))
    if union := node.get("anyOf") or node.get("oneOf") or node.get("allOf"):
        found = set().union(*(leaves(schema, part, key, seen) for part in union))
        return found - {key} if len(found) > 1 else found
    if properties := node.get("properties"):
        return set().union(*(leaves(schema, part, (*key, name), seen) for name, part in properties.items()))
    inner = node.get("additionalProperties") or node.get("items")
    return leaves(schema, inner, key, seen) if isinstance(inner, dict) else {key}


def test_every_key_is_in_a_configuration_or_in_the_manual():
    schema = json.loads((CHECKOUT / "config/schema.json").read_text())
    pages = [*(CHECKOUT / "docs").rglob("*.md"), CHECKOUT / "README.md", CHECKOUT / "config/README.md"]
    files = [*pages, *(CHECKOUT / "config").glob("*.yaml"), *(CHECKOUT / "config/overlays").glob("*.yaml")]
    files += (CHECKOUT / "config/sites").glob("*.yaml")
    words = {word for path in files for word in re.findall(r"\w+", path.read_text())}
    assert sorted(".".join(key) for key in leaves(schema, schema) if key[-1] not in words) == []
