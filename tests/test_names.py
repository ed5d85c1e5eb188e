"""Names are assigned once per scope, and the size of a photo is defined once."""

import ast
from collections.abc import Iterator
from itertools import chain
from pathlib import Path

from tests.support.polar_photos import HEIGHT, WIDTH

CHECKOUT = Path(__file__).parent.parent
FOLDERS = ("polarsim", "workflow/scripts", "benchmarks", "tests")
BRANCHES = ("body", "orelse", "finalbody", "handlers", "cases")


def tree_of(path: Path) -> ast.Module:
    """Parse a file; trees are not stored, because the garbage collector would traverse millions of nodes."""
    return ast.parse(path.read_text(encoding="utf-8"))


def targets(node: ast.AST) -> Iterator[str]:
    """Return the names that an assignment target binds; `a.b` and `a[0]` bind none."""
    if isinstance(node, ast.Name):
        yield node.id
    elif isinstance(node, ast.Tuple | ast.List):
        yield from chain.from_iterable(targets(element) for element in node.elts)
    elif isinstance(node, ast.Starred):
        yield from targets(node.value)


def bound(node: ast.stmt) -> Iterator[str]:
    """Return the names that a statement binds."""
    if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef):
        overloads = {ast.unparse(decorator).split(".")[-1] for decorator in node.decorator_list}
        yield from () if overloads & {"overload", "setter", "deleter"} else (node.name,)
    elif isinstance(node, ast.Assign):
        yield from chain.from_iterable(targets(target) for target in node.targets)
    elif isinstance(node, ast.AugAssign | ast.For) or (isinstance(node, ast.AnnAssign) and node.value):
        yield from targets(node.target)
    elif isinstance(node, ast.Import | ast.ImportFrom):
        yield from (alias.asname or alias.name for alias in node.names)


def statements(body: list[ast.stmt]) -> Iterator[ast.stmt]:
    """Yield the statements of a scope, including branches and loops."""
    for node in body:
        yield node
        if not isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef):
            for branch in BRANCHES:
                yield from statements(getattr(node, branch, []))


def classes(body: list[ast.stmt]) -> Iterator[ast.ClassDef]:
    """Yield the classes of a scope and of the functions and classes in it."""
    for node in statements(body):
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef):
            yield from (node,) if isinstance(node, ast.ClassDef) else ()
            yield from classes(node.body)


def repeated(tree: ast.Module) -> list[str]:
    """Return `line: name` of each repeated binding of a name in the module or a class."""
    found = []
    for scope in [tree, *classes(tree.body)]:
        seen: set[str] = set()
        for node in statements(scope.body):
            names = list(bound(node))
            found += [f"{node.lineno}: {name}" for name in names if name in seen]
            seen.update(names)
    return found


def test_no_name_of_a_module_or_class_is_assigned_twice():
    paths = [path for folder in FOLDERS for path in sorted((CHECKOUT / folder).rglob("*.py"))]
    assert len(paths) > 500
    found = {path.relative_to(CHECKOUT).as_posix(): repeated(tree_of(path)) for path in paths}
    assert {path: names for path, names in found.items() if names} == {}


def test_a_public_function_or_class_has_its_name_in_one_package_only():
    packages: dict[str, set[str]] = {}
    for path in sorted((CHECKOUT / "polarsim").rglob("*.py")):
        for node in tree_of(path).body:
            if isinstance(node, ast.FunctionDef | ast.ClassDef) and not node.name.startswith("_"):
                package = path.relative_to(CHECKOUT / "polarsim").with_suffix("").parts[0]
                packages.setdefault(node.name, set()).add(package)
    del packages["main"]  # entry points of programs
    assert {name: found for name, found in packages.items() if len(found) > 1} == {}


def test_the_size_of_a_photo_is_that_of_the_site():
    """Width and height of NASA's photos and their halves occur only in the constant to which other lengths refer."""
    sizes = {WIDTH, HEIGHT, WIDTH // 2, HEIGHT // 2}
    found = {
        path.relative_to(CHECKOUT).as_posix()
        for path in sorted((CHECKOUT / "polarsim").rglob("*.py"))
        if any(str(size) in path.read_text(encoding="utf-8").replace("_", "") for size in sizes)
        for node in ast.walk(tree_of(path))
        if isinstance(node, ast.Constant) and type(node.value) is int and node.value in sizes
    }
    assert found == {"polarsim/photo.py"}


def names_of(node: ast.AST) -> list[str]:
    """Return the name that a node defines or uses."""
    attribute = {ast.Name: "id", ast.arg: "arg", ast.FunctionDef: "name"}.get(type(node))
    return [getattr(node, attribute)] if attribute else []


def test_a_figure_is_a_picture():
    """Numbers are metrics, values or statistics: code outside the modules that draw has no name with `figure`."""
    drawing = ("report/", "lint/errata.py", "paths/")
    named = {
        f"{path.relative_to(CHECKOUT)}:{node.lineno}: {name}"
        for path in sorted((CHECKOUT / "polarsim").rglob("*.py"))
        if not path.relative_to(CHECKOUT / "polarsim").as_posix().startswith(drawing)
        if "figure" in path.read_text(encoding="utf-8")
        for node in ast.walk(tree_of(path))
        for name in names_of(node)
        if {"figure", "figures"} & set(name.split("_"))
    }
    assert named == set()
