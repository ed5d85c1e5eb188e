import ast
import pickle
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

import pytest

from polarsim import errors
from polarsim.errors import DetectError, FormatError, LabelError, PolarsimError, about, within
from polarsim.formats import tables, yolo
from polarsim.rover.drive.energy import EnergyError
from polarsim.rover.drive.state import OffGridError

ROOT = Path(__file__).parents[1]
KINDS = [kind for kind in vars(errors).values() if isinstance(kind, type) and issubclass(kind, PolarsimError)]
SEARCHES = {
    "split", "rsplit", "splitlines", "partition", "rpartition", "removeprefix", "removesuffix", "startswith",
    "endswith", "find", "rfind", "index", "rindex", "isdigit", "match", "search", "fullmatch", "findall", "finditer",
}  # fmt: skip


def fail(path):
    with about(path), within("annotation 3"):
        raise FormatError("no box", line=7)


@pytest.mark.parametrize("kind", [*KINDS, EnergyError, OffGridError])
def test_a_pickled_error_keeps_its_fields(kind):
    with pytest.raises(kind) as caught, about("labels.txt"), within("image 2"):
        raise kind("5 fields", line=3)
    copy = pickle.loads(pickle.dumps(caught.value))
    assert type(copy) is kind
    assert (copy.reason, copy.path, copy.line) == ("image 2: 5 fields", Path("labels.txt"), 3)
    assert str(copy) == "labels.txt:3: image 2: 5 fields"


def test_an_error_of_another_process_keeps_its_fields():
    with ProcessPoolExecutor(1) as pool, pytest.raises(FormatError) as caught:
        pool.submit(fail, Path("some/labels.txt")).result()
    error = caught.value
    assert (error.reason, error.path, error.line) == ("annotation 3: no box", Path("some/labels.txt"), 7)


def test_a_file_that_is_known_is_not_hidden():
    with pytest.raises(LabelError) as caught, about("folder"), about("inner.txt"):
        raise LabelError("no key", "file.txt", 4)
    assert str(caught.value) == "file.txt:4: no key"


def test_people_read_position_and_reason(tmp_path):
    path = tmp_path / "01_A_off_180_L_0256.txt"
    path.write_text("0 0.5 0.5 0.1 0.1\n\n0 0.5 0.5 0.1\n")
    with pytest.raises(FormatError) as caught:
        yolo.read_boxes(path)
    assert str(caught.value).startswith(f"{path}:3: 4 fields, expected a box of 5")
    table = tmp_path / "split.csv"
    table.write_text("key\n1\n")
    with pytest.raises(FormatError) as caught:
        tables.read_csv(table, ["key", "part"])
    assert str(caught.value) == f"{table}: column 'part' is missing"
    assert str(DetectError("training diverged")) == "training diverged"


def reads_of_messages(source):
    """Lines where the text of a caught error of ours is searched, cut or compared."""
    ours = {kind.__name__ for kind in KINDS} | {"EnergyError", "OffGridError"}
    found = []
    for handler in ast.walk(ast.parse(source)):
        if not isinstance(handler, ast.ExceptHandler) or not handler.name or handler.type is None:
            continue
        if not ours & {getattr(node, "id", getattr(node, "attr", "")) for node in ast.walk(handler.type)}:
            continue
        body = [node for statement in handler.body for node in ast.walk(statement)]
        texts = {
            target.id
            for node in body
            if isinstance(node, ast.Assign) and is_text(node.value, handler.name, set())
            for target in node.targets
            if isinstance(target, ast.Name)
        }
        found += [node.lineno for node in body if is_read(node, handler.name, texts)]
    return found


def is_text(node, error, texts):
    """Whether an expression holds `str(error)`, `repr(error)`, `f"{error}"` or a name of one of these."""
    for part in ast.walk(node):
        made = isinstance(part, ast.Call) and getattr(part.func, "id", "") in ("str", "repr", "format")
        inside = part.args if made else [part.value] if isinstance(part, ast.FormattedValue) else []
        if any(getattr(argument, "id", "") == error for argument in inside) or getattr(part, "id", "") in texts:
            return True
    return False


def is_read(node, error, texts):
    if isinstance(node, ast.Attribute) and node.attr == "args" and getattr(node.value, "id", "") == error:
        return True
    if isinstance(node, ast.Compare):
        return any(is_text(part, error, texts) for part in (node.left, *node.comparators))
    if isinstance(node, ast.Subscript):
        return is_text(node.value, error, texts)
    if isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute) and node.func.attr in SEARCHES:
        return any(is_text(part, error, texts) for part in (node.func.value, *node.args))
    return False


@pytest.mark.parametrize("folder", ["polarsim", "workflow", "benchmarks"])
def test_no_code_reads_the_text_of_an_error(folder):
    paths = sorted((ROOT / folder).rglob("*.py"))
    assert paths
    found = {path: reads_of_messages(path.read_text(encoding="utf-8")) for path in paths}
    assert [f"{path}:{line}" for path, lines in found.items() for line in lines] == []


@pytest.mark.parametrize(
    "line",
    [
        "where = str(error).removeprefix(path).partition(':')[0]",
        "found = re.match('.*:([0-9]+)', str(error))",
        "number = error.args[0]",
        "text = f'{error}'; number = text.split(':')[1]",
        "known = path in str(error)",
    ],
)
def test_reading_the_text_of_an_error_is_recognised(line):
    assert reads_of_messages(f"try:\n    read()\nexcept (FormatError, OSError) as error:\n    {line}\n")


def test_telling_an_error_on_is_no_reading():
    handler = "raise DetectError(f'no view, {error}', error.path) from error"
    assert not reads_of_messages(f"try:\n    read()\nexcept FormatError as error:\n    {handler}\n")
