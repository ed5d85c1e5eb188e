"""Each job of a plan calls functions with values of the annotated types, in every form of Snakemake."""

import ast
import contextlib
import io
import runpy
from collections.abc import Callable, Iterable, Iterator, Sequence
from importlib import import_module
from inspect import signature
from pathlib import Path
from typing import Any, get_type_hints

import pytest
import yaml
from pydantic import ConfigDict, TypeAdapter, ValidationError
from snakemake.api import SnakemakeApi
from snakemake.iocontainers import Snakemake
from snakemake.settings.types import ConfigSettings, DAGSettings, OutputSettings, Quietness, ResourceSettings

from polarsim import reporting
from polarsim.digest import script_digest
from polarsim.formats.release import polygon_folder
from tests.workflow.conftest import SMALL

WORKFLOW = Path(__file__).parents[2] / "workflow"
ANALOG = SMALL | {
    "terrains": [1, 3],
    "detect": SMALL["detect"]
    | {"others": {"small": {"model": "compact"}}, "stereo": {"run": True}, "seeds": [0, 1]}
    | {"elsewhere": {"mars": "mars"}},
    "gap": SMALL["gap"] | {"components": {"pose": {"cameras": "truth", "meshes": "thinned"}}},
    "rover": {
        "run": True,
        "world": {"terrains": [1]},
        "fine_tuning": {"drives": ["other"]},
        "cameras": {"videos": True, "onboard": {"weights": "packaged"}},
        "autonomy": {"run": True, "modes": ["truth", "both"], "detectors": ["packaged", "hapke"]},
    },
}
FITTED = SMALL | {
    "gap": {},
    "render": {"models": ["hapke", "lambert"], "materials_from_photos": True, "maps": ["depth"]},
}
WITHOUT_SCANS = SMALL | {"source": SMALL["source"] | {"scans": False}}
COVERS = {
    "run": True,
    "publish": True,
    "folds": [[1], [3]],
    "fine_tuning": {"windows": 2},
}
RELEASE = {
    "run": "release",
    "terrains": [1, 3],
    "positions": ["A"],
    "source": {"kind": "release", "root": "release"},
    "labels": {"seeds": {"light": "off", "camera": "L", "azimuths": ["30"], "exposure": "best"}},
    "covers": COVERS,
    "detect": {"seeds": [0, 1], "training": {"model": "compact", "masks": True}},
}
FITTED_RELEASE = RELEASE | {
    "covers": {},
    "detect": {},
    "render": {"models": ["principled", "fitted"]},
    "rocks": {"ground_from_photos": True},
}
ONE_SEED = RELEASE | {
    "covers": COVERS | {"carved_scenes": 0},
    "detect": {"seeds": [0], "training": {"model": "compact"}},
}
POLAR = {
    "run": "polar",
    "terrains": [1],
    "source": {"kind": "files", "root": "polar", "urls": {"Terrain01.zip": "https://example.org/Terrain01.zip"}},
    "labels": {"seeds": {"root": "release"}},
}
PLANS = (
    (ANALOG, ("all", "rover", "rover_autonomy", "publish", "rock_diameters", "elsewhere")),
    (FITTED, ("all",)),
    (WITHOUT_SCANS, ("rocks",)),
    (RELEASE, ("all", "real_tables", "field_detector")),
    (FITTED_RELEASE, ("render", "before_after")),
    (ONE_SEED, ("cover_photos",)),
    (POLAR, ("tables",)),
)


@pytest.fixture
def files(checkout: Path) -> Path:
    """A checkout with all input files of the plans; the files are empty, because no file is read."""
    for path in (
        "other/front_end_cam/poses.parquet",
        "mars/images/a.png",
        *(
            f"release/{path}"
            for terrain in ("01", "03")
            for path in (
                f"Labels/Terrain{terrain}/{terrain}_A_off_30_L_0256.txt",
                f"CoverPhotoOfIndices/cover_photo_indexed_{terrain}_A.png",
                f"TerrainMeshes/Terrain{terrain}/terrain{terrain}_rock1.obj",
            )
        ),
    ):
        (checkout / path).parent.mkdir(parents=True, exist_ok=True)
        (checkout / path).touch()
    polygons = polygon_folder(checkout / "release", 1) / "01_A_off_30_L_0256.txt"
    polygons.parent.mkdir(parents=True)
    polygons.touch()
    return checkout


@contextlib.contextmanager
def jobs_of(folder: Path, content: dict, targets: tuple[str, ...]) -> Iterator[list[Any]]:
    """Yield the jobs of a configuration that run scripts."""
    (folder / "planned.yaml").write_text(yaml.safe_dump(content))
    with SnakemakeApi(OutputSettings(quiet={Quietness.ALL})) as api:
        workflow = api.workflow(
            ResourceSettings(cores=1),
            ConfigSettings(configfiles=[folder / "planned.yaml"]),
            snakefile=Path("Snakefile"),
        )
        plan = workflow.dag(dag_settings=DAGSettings(targets=set(targets)))
        with contextlib.redirect_stdout(io.StringIO()):
            plan.printrulegraph()
        yield [job for job in plan.workflow_api._workflow.dag.jobs if job.rule.script]


def checked(function: Callable) -> Callable:
    """Return a substitute of a function that only checks the arguments against the annotations."""
    hints = get_type_hints(function)

    def check(**given: object) -> None:
        signature(function).bind(**given)
        for name, value in given.items():
            annotated = TypeAdapter(tuple[hints[name]], config=ConfigDict(arbitrary_types_allowed=True, strict=True))
            (converted,) = annotated.validate_python((value,))
            if isinstance(converted, Iterator):  # items of an Iterable are checked when they are read
                list(converted)
        calls.append(function.__name__)

    calls = check.calls = []
    return check


def called_by(script: Path) -> list[tuple[Any, str]]:
    """Return module and name of the functions that a script calls."""
    tree = ast.parse(script.read_text())
    modules = {
        alias.name: node.module for node in tree.body if isinstance(node, ast.ImportFrom) for alias in node.names
    }
    calls = next(node.body for node in tree.body if isinstance(node, ast.With))
    return [(import_module(modules[call.value.func.id]), call.value.func.id) for call in calls]


def run(job: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    """Run the script of a job with the values of Snakemake and substitutes of the called functions."""
    script = WORKFLOW / "scripts" / Path(job.rule.script).name
    checks = {name: checked(getattr(module, name)) for module, name in called_by(script)}
    with monkeypatch.context() as patched:
        for module, name in called_by(script):
            patched.setattr(module, name, checks[name])
        patched.setattr(reporting, "reporting", lambda log: contextlib.nullcontext(log))
        patched.setattr("polarsim.detect.split.tested_keys", lambda splits: frozenset())
        given = Snakemake(
            job.input._plainstrings(), job.output._plainstrings(), job.params, job.wildcards, job.threads,
            job.resources, job.log._plainstrings(), {}, job.rule.name, None,
        )  # fmt: skip
        runpy.run_path(str(script), {"snakemake": given})
    assert [check.calls for check in checks.values()] == [[name] for name in checks]


def test_every_script_calls_its_function_with_values_of_the_annotated_types(files, monkeypatch):
    monkeypatch.chdir(files)
    tried = set()
    for content, targets in PLANS:
        with jobs_of(files, content, targets) as jobs:
            for job in jobs:
                assert job.params.code == script_digest(WORKFLOW / "scripts" / Path(job.rule.script).name)
                assert len(job.log) == 1
                run(job, monkeypatch)
            tried |= {Path(job.rule.script).stem for job in jobs}
    assert tried == {path.stem for path in (WORKFLOW / "scripts").glob("*.py")}


def test_a_string_in_place_of_paths_or_of_a_path_is_found():
    def draw(pictures: Iterable[Path], figure: Path, keys: Sequence[str] = ()) -> None: ...

    checked(draw)(pictures=[Path("a.parquet")], figure=Path("a.png"), keys=["a"])
    for wrong in ({"pictures": "a.parquet"}, {"pictures": ["a.parquet"]}, {"figure": "a.png"}, {"keys": "a"}):
        with pytest.raises(ValidationError):
            checked(draw)(**{"pictures": [], "figure": Path("a.png")} | wrong)
