"""Six walks of a newcomer: the table in CONTRIBUTING.md answers each with at most two files, and it answers right."""

import ast
import re
from collections.abc import Iterator
from importlib import import_module
from pathlib import Path

import numpy as np
import pytest

from polarsim import digest
from polarsim.config import Config
from polarsim.formats.obj import Mesh
from polarsim.rocks.folder import write_named

CHECKOUT = Path(__file__).parent.parent
SCRIPTS, RULES = CHECKOUT / "workflow/scripts", CHECKOUT / "workflow/rules"
WALKS = ("label is scored", "exposure acts", "column to a table", "reads truth", "swap the detector", "`meshes.csv`")


def answer(walk: str) -> tuple[list[str], list[str]]:
    """Files and names that the table gives to a question."""
    text = (CHECKOUT / "CONTRIBUTING.md").read_text()
    (row,) = [line for line in text.splitlines() if line.startswith("|") and walk in line.split("|")[1]]
    _, _, files, names, _ = row.split("|")
    return re.findall(r"`([\w/.]+)`", files), re.findall(r"`([\w.]+)`", names)


def defined(file: str) -> set[str]:
    """Functions, classes, constants and rules that a file defines; a page defines none."""
    text = (CHECKOUT / file).read_text()
    if file.endswith(".md"):
        return set()
    if file.endswith(".smk"):
        return set(re.findall(r"^\s*rule (\w+):", text, re.MULTILINE))
    found = set()
    for node in ast.parse(text).body:
        if isinstance(node, ast.FunctionDef | ast.ClassDef):
            found.add(node.name)
        targets = getattr(node, "targets", [getattr(node, "target", None)])
        found |= {part.id for target in targets if target for part in ast.walk(target) if isinstance(part, ast.Name)}
    return found


def module_of(file: str) -> str:
    return file.removesuffix(".py").replace("/", ".")


def reached(script: str) -> set[str]:
    """Modules of polarsim that a script of the workflow runs, at any depth."""
    imported = [module for module, _ in imports(SCRIPTS / f"{script}.py") if module.startswith("polarsim")]
    return digest._reached(imported)


def imports(path: Path) -> Iterator[tuple[str, str]]:
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.ImportFrom) and node.module:
            yield from ((node.module, alias.name) for alias in node.names)


def calls(path: Path, name: str) -> bool:
    called = [node.func for node in ast.walk(ast.parse(path.read_text())) if isinstance(node, ast.Call)]
    return any(name in (getattr(part, "id", None), getattr(part, "attr", None)) for part in called)


@pytest.mark.parametrize("walk", WALKS)
def test_a_walk_ends_in_at_most_two_files_that_define_what_is_named(walk):
    files, names = answer(walk)
    assert 1 <= len(files) <= 2
    assert all((CHECKOUT / file).exists() for file in files)
    assert names
    known = set().union(*(defined(file) for file in files))
    assert set(names) <= known


def test_a_label_is_scored_there():
    files, (score, count) = answer("label is scored")
    assert (module_of(files[0]), score) in set(imports(SCRIPTS / "score_labels.py"))
    assert calls(SCRIPTS / "score_labels.py", score)
    assert (module_of(files[1]), count) in set(imports(CHECKOUT / files[0]))
    assert calls(CHECKOUT / files[0], count)


def test_exposure_acts_on_a_pixel_there_and_nowhere_else():
    """One function for twins, views and the rover; the analog shares no code with what it tests, so it has its own."""
    files, (expose,) = answer("exposure acts")
    everywhere = (str(path.relative_to(CHECKOUT)) for path in (CHECKOUT / "polarsim").rglob("*.py"))
    assert {file for file in everywhere if expose in defined(file)} == set(files)
    own, analog = sorted(files, key=lambda file: "analog" in file)
    for script in ("render_twins", "see_drive"):
        assert module_of(own) in reached(script)
        assert module_of(analog) not in reached(script)
    assert module_of(analog) in reached("generate_analog")


def test_a_column_of_a_table_is_declared_and_filled_there():
    (schemas, table), names = answer("column to a table")
    script = SCRIPTS / "tabulate_labels.py"
    assert any((module_of(table), name) in set(imports(script)) and calls(script, name) for name in names)
    assert ("polarsim.schemas.report", "LABELS") in set(imports(CHECKOUT / table))
    assert module_of(schemas) == "polarsim.schemas.report"


def test_these_rules_read_truth_and_no_others():
    files, _ = answer("reads truth")
    given = r"=\s*PATHS\.(truth|true_labels|annotated_labels|annotated_polygons)\b"
    files_of_rules = (*RULES.glob("*.smk"), CHECKOUT / "workflow/Snakefile")
    readers = {path for path in files_of_rules if re.search(given, path.read_text())}
    assert {str(path.relative_to(CHECKOUT)) for path in readers} == set(files)


def test_a_detector_is_chosen_there():
    files, (family, options) = answer("swap the detector")
    named = getattr(import_module(module_of(files[1])), options)
    detect = Config.model_fields["detect"].annotation
    assert named in {detect, *(field.annotation for field in detect.model_fields.values())}
    assert "model" in named.model_fields
    for script in ("train_detector", "predict"):
        assert module_of(files[0]) in reached(script)
    chosen = getattr(import_module(module_of(files[0])), family)
    own, others = chosen("compact"), chosen("yolov8n")
    assert own is not others
    assert all(callable(getattr(one, name)) for one in (own, others) for name in ("train", "load"))


def test_meshes_csv_is_written_there(tmp_path):
    files, names = answer("`meshes.csv`")
    assert write_named.__name__ in names
    assert module_of(files[0]) == write_named.__module__
    corners = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]])
    tetrahedron = Mesh(corners, np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]]))
    write_named(tmp_path, {"terrain01_rock1.obj": tetrahedron}, {"terrain01_rock1.obj": "scan"})
    assert (tmp_path / "meshes.csv").read_text().startswith("mesh,")
    everywhere = (CHECKOUT / "polarsim").rglob("*.py")
    writers = [path for path in everywhere if re.search(r"write_csv\(.*MESH_TABLE", path.read_text())]
    assert [str(path.relative_to(CHECKOUT)) for path in writers] == files[:1]
    assert {module_of(files[0])} <= reached("mesh_rocks") & reached("adopt_rocks") & reached("repair_rocks")
