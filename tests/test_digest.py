"""A digest changes with the code that is used, and with nothing else."""

import ast
from pathlib import Path

from polarsim import digest


def test_the_digest_reaches_what_is_imported_inside_functions():
    assert "polarsim.geometry.rays_embree" in digest.imported_modules("polarsim.geometry.rays")


def test_docstrings_and_comments_do_not_count():
    plain = ast.parse("def area(r):\n    return 3 * r * r\n")
    told = ast.parse('"""Areas."""\n\ndef area(r):\n    """Of a disc."""\n    return 3 * r * r  # nearly\n')
    assert ast.dump(digest._without_docstrings(told)) == ast.dump(plain)


def test_the_renderer_is_no_part_of_the_meshes():
    assert not any("render" in name for name in digest._reached(("polarsim.rocks.mesh",)))
    assert digest.code_digest("polarsim.rocks.mesh") != digest.code_digest("polarsim.render.twins")


def test_imports_run_one_way():
    """Stages see the floors below and themselves, never one another; the floors below see no stage."""
    package = Path(digest.__file__).parent
    stages = {"acquire", "analog", "cameras", "rocks", "labels", "render", "detect", "tables", "rover"}
    below_rover = {"render", "detect"}  # its ground changes while it drives, so it renders and judges itself
    floors = ["digest", "errors", "photo", "survey", "randomness", "grid", "progress", "geometry", "formats"]
    for path in sorted(package.rglob("*.py")):
        parts = path.relative_to(package).with_suffix("").parts
        place = parts[0]
        if place not in stages and place not in floors:
            continue  # cli, config and their like stand above all
        name = ".".join(("polarsim", *(part for part in parts if part != "__init__")))
        seen = {module.split(".")[1] for module in digest.imported_modules(name) if module != "polarsim"}
        forbidden = (stages - {place}) if place in stages else stages
        forbidden = forbidden - below_rover if place == "rover" else forbidden
        assert not seen & forbidden, f"{name} imports {sorted(seen & forbidden)}"
        above = {"cli", "config", "reporting", "pages"}
        assert not seen & above, f"{name} imports {sorted(seen & above)}"
