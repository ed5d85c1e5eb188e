"""What the Snakemake workflow catalogue requires of a repository, and one source for each file that it reads."""

import tomllib

import pytest
import yaml
from jsonschema import Draft202012Validator
from packaging.requirements import Requirement
from packaging.specifiers import SpecifierSet

from polarsim.running import run
from polarsim.running.catalogue_schema import catalogue_schema
from tests.workflow.conftest import CHECKOUT, SMALL, planned

OTHERS = ("views", "viper")  # no configurations of a run
CONFIGURATIONS = [
    path
    for folder in ("config", "config/overlays", ".test/config")
    for path in sorted((CHECKOUT / folder).glob("*.yaml"))
    if path.stem not in OTHERS
]
SCHEMA = CHECKOUT / "workflow/schemas/config.schema.yaml"


def test_the_repository_has_the_files_of_a_standardised_workflow():
    usage = yaml.safe_load((CHECKOUT / ".snakemake-workflow-catalog.yml").read_text())["usage"]
    assert set(usage) == {"mandatory-flags", "software-stack-deployment", "report"}
    assert set(usage["mandatory-flags"]) == {"desc", "flags"}
    for name in ("workflow/Snakefile", "config/README.md", "config/config.yaml", ".test/config/config.yaml", "LICENSE"):
        assert (CHECKOUT / name).is_file(), name
    assert "workflow" in (CHECKOUT / "README.md").read_text().lower()


def test_the_schema_without_references_is_the_configurations():
    assert SCHEMA.read_text() == catalogue_schema(), "run make schema"
    assert "$ref" not in SCHEMA.read_text()


@pytest.mark.parametrize("path", CONFIGURATIONS, ids=lambda path: str(path.relative_to(CHECKOUT)))
def test_the_schema_accepts_the_configurations_and_no_mistyped_key(path):
    content = yaml.safe_load(path.read_text())
    validator = Draft202012Validator(yaml.safe_load(SCHEMA.read_text()))
    missing = [error.message for error in validator.iter_errors(content)]
    assert [text for text in missing if "'source' is a required property" not in text] == []
    assert not validator.is_valid(content | {"terains": [1]})
    assert not validator.is_valid(content | {"detect": {"trainning": {}}})


def test_min_version_is_the_requirement_of_the_project():
    project = tomllib.loads((CHECKOUT / "pyproject.toml").read_text())["project"]
    (needed,) = [
        one for one in map(Requirement, project["optional-dependencies"]["pipeline"]) if one.name == "snakemake"
    ]
    (version,) = [
        line.split('"')[1]
        for line in (CHECKOUT / "workflow/Snakefile").read_text().splitlines()
        if "min_version(" in line
    ]
    assert needed.specifier == SpecifierSet(f">={version},<{int(version.split('.')[0]) + 1}")


def test_the_default_profile_sets_what_polarsim_run_sets():
    profile = yaml.safe_load((CHECKOUT / "workflow/profiles/default/config.yaml").read_text())
    words = [word for key, value in profile.items() for word in (f"--{key}", *([] if value is True else [str(value)]))]
    assert sorted(words) == sorted(run._FIXED)


def test_the_small_run_is_planned_with_the_default_profile(checkout, snakemake):
    test = checkout / ".test/config"
    test.mkdir(parents=True)
    (test / "config.yaml").write_text(yaml.safe_dump(SMALL))
    done = snakemake(checkout, "--snakefile", "workflow/Snakefile", "--directory", ".test", "--dry-run")
    jobs, text = planned(done), done.stdout + done.stderr
    assert (jobs["generate_analog"], jobs["train_detector"], jobs["run_ablation"]) == (1, 3, 1)
    assert "workflow/profiles/default" in text
