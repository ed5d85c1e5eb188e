"""A digest depends only on the code that is used; imports follow the layers of the design."""

import ast
import json
import re
import subprocess
import sys
from collections.abc import Iterable, Iterator, Sequence
from graphlib import TopologicalSorter
from pathlib import Path

from polarsim import digest

FLOORS = (  # from bottom to top: a package or module imports only lower floors
    {"errors", "digest", "progress", "public", "randomness", "user_path"},
    {"extras", "intervals", "kernels", "photo", "schemas", "wording"},
    {"site_parts"},
    {"site_file_names"},
    {"site"},
    {"geometry", "grid", "photo_format", "tone"},
    {"formats"},
    {"provenance"},
    {"run_files", "download"},
    {"sources"},
    {"acquire", "analog", "cameras", "rocks", "labels", "render", "detect", "scoring", "annotate", "lint"},
    {"scenes", "relief"},
    {"rover", "cover_photos", "report", "publish", "explore"},
    {"arguments", "config", "job_files", "reporting"},
    {"paths"},
    {"running"},
    {"cli"},
    {"__main__"},
)
BASIC = {f"polarsim.formats.{name}" for name in ("files", "readers", "yaml_files")}  # low modules, which `site` uses
TALLER = {  # imports of stages by packages above: rendering of drives and scenes, scores in reports, rectification
    # for KITTI, false positives and corrections in the explorer
    "rover": {"render", "detect"},
    "scenes": {"rocks", "render"},
    "relief": {"rocks", "render"},
    "cover_photos": {"detect"},
    "report": {"scoring", "annotate"},
    "publish": {"detect"},
    "explore": {"labels", "detect"},
}


def all_imports(folder: str = "") -> dict[str, tuple[str, ...]]:
    """Return the imports of each module of polarsim, or of a folder of it."""
    package = Path(digest.__file__).parent
    paths = [path.relative_to(package.parent) for path in sorted((package / folder).rglob("*.py"))]
    names = [".".join(path.with_suffix("").parts).removesuffix(".__init__") for path in paths]
    return {name: digest.imported_modules(name) for name in names}


def between(imports: dict[str, Iterable[str]], depth: int) -> Iterator[tuple[str, str, str]]:
    """Yield importing part, imported part and a description of imports between parts of a package at a depth."""
    for module, others in imports.items():
        for other in others:
            one, two = module.split("."), other.split(".")
            if min(len(one), len(two)) > depth and one[:depth] == two[:depth] and one[depth] != two[depth]:
                yield one[depth], two[depth], f"{module} imports {other}"


def floor_of(floors: Sequence[set[str]]) -> dict[str, int]:
    return {part: number for number, parts in enumerate(floors) for part in parts}


def test_imports_point_downwards_without_cycles():
    imports, floor = all_imports(), floor_of(FLOORS)
    assert {name.split(".")[1] for name in imports if "." in name} == set(floor)
    stages = FLOORS[floor["lint"]]
    assert {other for name in BASIC for other in imports[name]} <= {"polarsim.errors", "polarsim.extras", *BASIC}
    above = {name: set(others) - BASIC for name, others in imports.items()}
    for own, seen, text in between(above, 1):
        assert floor[seen] < floor[own], text
        assert seen not in stages or seen in TALLER.get(own, stages), text
    TopologicalSorter(imports).prepare()  # raises an error for a cycle


def test_only_scoring_reads_ground_truth():
    """Rules with ground truth or annotations as input run only code of `scoring`."""
    given = re.compile(r"=\s*PATHS\.(truth|true_labels|annotated_labels|annotated_polygons)\b")
    for path in sorted(RULES.glob("*.smk")):
        for block in re.split(r"^(?=\s*rule \w+:$)", path.read_text(), flags=re.MULTILINE):
            script = re.search(r'"\.\./scripts/(\w+)\.py"', block)
            if script and given.search(block):
                modules = imports_by_text((SCRIPTS / f"{script[1]}.py").read_text())
                packages = {".".join(module.split(".")[:2]) for module in modules}
                of_scripts = {
                    "polarsim.job_files",
                    "polarsim.reporting",
                    "polarsim.grid",
                    "polarsim.photo",
                    "polarsim.site",
                }
                assert packages <= {"polarsim.scoring", *of_scripts}, script[1]


ROVER_FLOORS = (  # from bottom to top: a subpackage imports only lower floors
    {"soil", "world", "vehicle"},
    {"drive"},
    {"cameras", "localisation"},
    {"perception", "export"},
    {"planning"},
    {"learn"},
    {"options", "run"},  # modules for the command line and the configuration
)
ROVER_BLIND = {"soil", "world", "vehicle", "drive"}  # a drive requires neither images nor detectors


def test_imports_of_the_rover_point_downwards():
    """Modules of the top floor may import each other."""
    imports, floor = all_imports("rover"), floor_of(ROVER_FLOORS)
    assert {name.split(".")[2] for name in imports if name != "polarsim.rover"} == set(floor)
    for own, seen, text in between(imports, 2):
        assert floor[seen] < floor[own] or floor[own] == len(ROVER_FLOORS) - 1, text
    for module, others in imports.items():
        if ROVER_BLIND & set(module.split(".")[2:3]):
            assert not {"render", "detect"} & {other.split(".")[1] for other in others if "." in other}, module


SCRIPTS = Path(digest.__file__).parent.parent / "workflow/scripts"
RULES = SCRIPTS.parent / "rules"


def imports_by_text(text: str) -> set[str]:
    """Return the imported modules of polarsim from the text of a file, independent of the digest."""
    flat = re.sub(r"\(([^)]*)\)", lambda found: " ".join(found[1].split()), text)
    found = set(re.findall(r"^\s*import (polarsim[\w.]*)$", flat, re.MULTILINE))
    for package, names in re.findall(r"^\s*from (polarsim[\w.]*) import (.+?)(?:#.*)?$", flat, re.MULTILINE):
        for name in filter(str.strip, names.split(",")):
            below = f"{package}.{name.split(' as ')[0].strip()}"
            found.add(below if file_of(below) else package)
    return found


def file_of(module: str) -> Path | None:
    position = Path(digest.__file__).parent.parent / module.replace(".", "/")
    return next((path for path in (position.with_suffix(".py"), position / "__init__.py") if path.is_file()), None)


def reached_by_text(script: Path) -> set[str]:
    reached, waiting = set(), list(imports_by_text(script.read_text()))
    while waiting:
        if (name := waiting.pop()) not in reached:
            reached.add(name)
            waiting += imports_by_text(file_of(name).read_text())
    return reached


def test_every_module_is_used():
    """By a script, a rule, the command line, the environment for learning, or a command of a document."""
    starts = {"polarsim.__main__", "polarsim.cli", "polarsim.render", "polarsim.schemas.__main__"}
    starts |= {"polarsim.running.catalogue_schema"}  # make schema
    starts |= {"polarsim.rover.learn.environment", "polarsim.labels.fit_annotator"}
    for path in [*SCRIPTS.glob("*.py"), *RULES.glob("*.smk"), SCRIPTS.parent / "Snakefile"]:
        starts |= imports_by_text(path.read_text())
    assert {name for name in all_imports() if file_of(name).name != "__init__.py"} - digest._reached(starts) == set()


def test_an_edit_of_any_file_that_a_script_reaches_changes_its_digest(monkeypatch):
    reached = {path.stem: reached_by_text(path) for path in sorted(SCRIPTS.glob("*.py"))}
    assert {script: digest._reached(digest._parsed(SCRIPTS / f"{script}.py")[1]) for script in reached} == reached
    users = {script for script, modules in reached.items() if "polarsim.grid" in modules}
    assert {"propagate_labels", "render_twins", "score_labels"} <= users < set(reached)
    before = {script: digest.script_digest(SCRIPTS / f"{script}.py") for script in reached}
    real = digest._module
    monkeypatch.setattr(
        digest, "_module", lambda name: ("edited", real(name)[1]) if name.endswith(".grid") else real(name)
    )
    assert {script for script in reached if digest.script_digest(SCRIPTS / f"{script}.py") != before[script]} == users


def test_an_edit_of_a_script_changes_its_digest_and_a_comment_does_not(tmp_path):
    script = tmp_path / "measure.py"
    script.write_text("from polarsim.grid import GridOptions\n")
    plain = digest.script_digest(script)
    script.write_text('"""Measure."""\n\nfrom polarsim.grid import GridOptions  # of a run\n')
    assert digest.script_digest(script) == plain
    script.write_text("from polarsim.grid import GridOptions\n\nprint(GridOptions())\n")
    assert digest.script_digest(script) != plain


def test_the_cached_result_equals_the_parsed_result(tmp_path):
    script = tmp_path / "measure.py"
    script.write_text("import numpy\nfrom polarsim import grid\nfrom polarsim.grid import GridOptions\n")
    parsed = digest._parsed(script)
    assert parsed[1] == ("polarsim.grid",)
    (kept,) = (tmp_path / "__pycache__").iterdir()
    assert digest._parsed(script) == parsed
    whole = json.loads(kept.read_bytes())
    kept.write_text(json.dumps(whole | {"code": "of what is kept"}))
    assert digest._parsed(script)[0] == "of what is kept"
    for broken in ("", "[]", json.dumps({"version": whole["version"]})):
        kept.write_text(broken)
        assert digest._parsed(script) == parsed
    script.write_text("import numpy\n")
    assert digest._parsed(script)[1] == ()


def test_digests_need_no_folder_that_can_be_written(tmp_path):
    script = tmp_path / "measure.py"
    script.write_text("from polarsim import grid\n")
    (tmp_path / "__pycache__").touch()  # no folder
    assert digest._parsed(script)[1] == ("polarsim.grid",)


def test_planning_a_run_imports_no_slow_module():
    planned = set().union(*(imports_by_text(path.read_text()) for path in RULES.glob("*.smk")))
    slow = {"torch", "scipy", "numba", "cv2", "matplotlib", "pandas"}
    code = f"import sys, {', '.join(sorted(planned))}; print(sorted({slow} & set(sys.modules)))"
    assert subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout == "[]\n"


def test_packages_contain_only_names_of_modules():
    """Therefore digests may exclude packages: an edit does not change the modules."""
    for path in sorted(Path(digest.__file__).parent.rglob("__init__.py")):
        kinds = {type(node) for node in digest._without_docstrings(ast.parse(path.read_text())).body}
        assert kinds <= {ast.Import, ast.ImportFrom, ast.Assign}, path


def test_only_one_script_imports_the_module_of_a_figure():
    """An edit of the module repeats the drawing of one figure and no scoring."""
    # `appearance`, `drive_images`: two similar figures; `detectors`: the same figures of a run and of real photos
    shared = {"appearance", "canvas", "cover_photos", "difference", "drive_images", "detectors"}
    scripts = {path.stem: path for path in sorted(SCRIPTS.glob("*.py"))}
    reached = {name: digest._reached(digest._parsed(path)[1]) for name, path in scripts.items()}
    figures = sorted((Path(digest.__file__).parent / "report/figures").glob("[a-z]*.py"))
    assert len(figures) > 15
    for figure in figures:
        drawing = [name for name, modules in reached.items() if f"polarsim.report.figures.{figure.stem}" in modules]
        assert drawing
        assert all(name.startswith(("draw_", "report_")) for name in drawing), f"{figure.stem}: {drawing}"
        assert len(drawing) == 1 or figure.stem in shared, f"{figure.stem}: {drawing}"


def test_scripts_read_declared_files_and_contain_no_path_of_results():
    for path in sorted(SCRIPTS.glob("*.py")):
        assert not re.search(r'"results"|results/', path.read_text()), path
