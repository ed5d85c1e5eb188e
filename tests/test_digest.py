"""A digest changes with the code that is used, and with nothing else."""

import ast
import json
import re
import subprocess
import sys
from collections.abc import Iterable
from graphlib import TopologicalSorter
from pathlib import Path

from polarsim import digest


def test_the_digest_reaches_what_is_imported_inside_functions():
    assert "polarsim.geometry.rays_taichi" in digest.imported_modules("polarsim.geometry.casters")


def test_docstrings_and_comments_do_not_count():
    plain = ast.parse("def area(r):\n    return 3 * r * r\n")
    told = ast.parse('"""Areas."""\n\ndef area(r):\n    """Of a disc."""\n    return 3 * r * r  # nearly\n')
    assert ast.dump(digest._without_docstrings(told)) == ast.dump(plain)


def test_the_renderer_is_no_part_of_the_meshes():
    assert not any("render" in name for name in digest._reached(("polarsim.rocks.mesh",)))
    assert digest.code_digest("polarsim.rocks.mesh") != digest.code_digest("polarsim.render.twins")


FLOORS = (  # from the bottom up: a package or module sees the floors below and itself, never one beside it
    {"errors", "digest", "progress", "public", "randomness", "survey", "user_path"},
    {"intervals", "kernels", "photo", "schemas"},
    {"geometry", "grid", "tone"},
    {"formats"},
    {"provenance"},
    {"run_files", "download"},
    {"sources"},
    {"acquire", "analog", "cameras", "rocks", "labels", "render", "detect", "scoring", "annotate", "lint"},
    {"scenes"},
    {"rover", "cover_photos", "report", "publish", "explore"},
    {"arguments", "config", "job_files", "reporting"},
    {"paths", "running"},
    {"cli"},
    {"__main__"},
)
TALLER = {  # of the stages these see only these: drives and strewn rocks are rendered, a report shows scores, what is
    # published for KITTI is rectified, the explorer counts false positives and reads corrections
    "rover": {"render", "detect"},
    "scenes": {"rocks", "render"},
    "cover_photos": {"detect"},
    "report": {"scoring", "annotate"},
    "publish": {"detect"},
    "explore": {"labels", "detect"},
}


def all_imports(folder: str = "") -> dict[str, tuple[str, ...]]:
    """Modules of polarsim, or of a folder of it, and what of polarsim each imports."""
    package = Path(digest.__file__).parent
    paths = [path.relative_to(package.parent) for path in sorted((package / folder).rglob("*.py"))]
    names = [".".join(path.with_suffix("").parts).removesuffix(".__init__") for path in paths]
    return {name: digest.imported_modules(name) for name in names}


def upwards(imports: dict[str, Iterable[str]]) -> list[str]:
    """The imports, module by module, that go up or sideways in `FLOORS`."""
    floor = {part: number for number, parts in enumerate(FLOORS) for part in parts}
    found = []
    for module, seen in imports.items():
        for other in seen:
            own, part = (name.split(".")[1] if "." in name else "" for name in (module, other))
            if part and own != part:  # polarsim itself holds the version
                stage = floor[part] == floor["lint"] and part not in TALLER.get(own, FLOORS[floor["lint"]])
                found += [f"{module} imports {other}"] if floor[part] >= floor[own] or stage else []
    return found


def test_imports_run_one_way_and_in_no_circle():
    imports = all_imports()
    assert {name.split(".")[1] for name in imports if "." in name} == set().union(*FLOORS)
    assert upwards(imports) == []
    TopologicalSorter(imports).prepare()  # raises where modules import each other in a circle


def test_only_scoring_reads_truth():
    """Rules that are given truth or people's labels run code of `scoring` alone; the analog's makers write truth."""
    given = re.compile(r"=\s*PATHS\.(truth|true_labels|annotated_labels|annotated_polygons)\b")
    for path in sorted(RULES.glob("*.smk")):
        for block in re.split(r"^(?=\s*rule \w+:$)", path.read_text(), flags=re.MULTILINE):
            script = re.search(r'"\.\./scripts/(\w+)\.py"', block)
            if script and given.search(block):
                modules = imports_by_text((SCRIPTS / f"{script[1]}.py").read_text())
                packages = {".".join(module.split(".")[:2]) for module in modules}
                of_scripts = {"polarsim.job_files", "polarsim.reporting", "polarsim.grid"}
                assert packages <= {"polarsim.scoring", *of_scripts}, script[1]


ROVER_FLOORS = (  # from the bottom up: a room sees the floors below and itself, rooms of one floor never each other
    {"soil", "world", "vehicle"},
    {"drive"},
    {"cameras"},
    {"perception", "export"},
    {"planning"},
    {"learn"},
    {"options", "run"},  # no rooms: where the command line and the configuration come in
)
ROVER_BLIND = {"soil", "world", "vehicle", "drive"}  # a drive needs neither pictures nor detectors


def room_of(module: str) -> str | None:
    """The rover's room that a module lies in; None for the rover's package itself and for what is not the rover's."""
    parts = module.split(".")
    return parts[2] if parts[:2] == ["polarsim", "rover"] and len(parts) > 2 else None


def against_the_floors(imports: dict[str, Iterable[str]]) -> list[str]:
    """The imports, module by module, that go up or sideways between the rover's rooms, or bring pictures into a drive.

    Beside the rooms lie modules; these may see each other.
    """
    floor = {room: number for number, rooms in enumerate(ROVER_FLOORS) for room in rooms}
    top, found = len(ROVER_FLOORS) - 1, []
    for module, seen in imports.items():
        own = room_of(module)
        if own is None:
            continue
        for other in seen:
            room = room_of(other)
            if room is None:
                wrong = own in ROVER_BLIND and other.split(".")[1] in {"render", "detect"}
            else:
                wrong = room != own and floor[room] >= floor[own] and floor[own] < top
            found += [f"{module} imports {other}"] if wrong else []
    return found


def test_the_rovers_rooms_stand_on_each_other():
    imports = all_imports("rover")
    assert {room_of(name) for name in imports} - {None} == set().union(*ROVER_FLOORS)
    assert against_the_floors(imports) == []


SCRIPTS = Path(digest.__file__).parent.parent / "workflow/scripts"
RULES = SCRIPTS.parent / "rules"


def imports_by_text(text: str) -> set[str]:
    """Modules of polarsim that a file's import lines name, found by another way than the digest's."""
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


def test_every_module_is_reached():
    """By a script or rule, by the command line, by who imports the environment for learners, or by a command."""
    starts = {"polarsim.__main__", "polarsim.cli", "polarsim.render", "polarsim.schemas.__main__"}
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


def test_what_is_kept_beside_a_file_says_what_parsing_it_says(tmp_path):
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


def test_planning_a_run_imports_nothing_that_takes_long():
    planned = set().union(*(imports_by_text(path.read_text()) for path in RULES.glob("*.smk")))
    slow = {"torch", "scipy", "numba", "cv2"}
    code = f"import sys, {', '.join(sorted(planned))}; print(sorted({slow} & set(sys.modules)))"
    assert subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout == "[]\n"


def test_packages_hold_nothing_but_names_of_their_modules():
    """So an edit of one changes nothing for whoever imports a module from it, and its digest may leave it out."""
    for path in sorted(Path(digest.__file__).parent.rglob("__init__.py")):
        kinds = {type(node) for node in digest._without_docstrings(ast.parse(path.read_text())).body}
        assert kinds <= {ast.Import, ast.ImportFrom, ast.Assign}, path


def test_only_one_script_imports_the_module_of_a_figure():
    """An edit of the module repeats the drawing of one figure and no scoring."""
    shared = {"canvas", "cover_photos", "difference", "shots"}  # `shots`: two of a kind
    scripts = {path.stem: path for path in sorted(SCRIPTS.glob("*.py"))}
    reached = {name: digest._reached(digest._parsed(path)[1]) for name, path in scripts.items()}
    figures = sorted((Path(digest.__file__).parent / "report/figures").glob("[a-z]*.py"))
    assert len(figures) > 15
    for figure in figures:
        drawing = [name for name, modules in reached.items() if f"polarsim.report.figures.{figure.stem}" in modules]
        assert drawing
        assert all(name.startswith(("draw_", "report_")) for name in drawing), f"{figure.stem}: {drawing}"
        assert len(drawing) == 1 or figure.stem in shared, f"{figure.stem}: {drawing}"


def test_an_edit_of_a_figure_changes_the_digest_of_its_script_and_of_no_scoring_script(monkeypatch):
    scripts = {path.stem: path for path in sorted(SCRIPTS.glob("*.py"))}
    before = {name: digest.script_digest(path) for name, path in scripts.items()}
    parsed, figure = digest._module, "polarsim.report.figures.contact"
    monkeypatch.setattr(digest, "_module", lambda name: ("edited", parsed(name)[1]) if name == figure else parsed(name))
    after = {name: digest.script_digest(path) for name, path in scripts.items()}
    assert {name for name in scripts if before[name] != after[name]} == {"draw_photos"}


def test_scripts_read_what_their_rules_declare_and_build_no_path_of_results():
    for path in sorted(SCRIPTS.glob("*.py")):
        assert not re.search(r'"results"|results/', path.read_text()), path
