"""Files of the page: size, completeness, no external references."""

import gzip
import re

import pytest

from polarsim.explore.server import TYPES
from polarsim.explore.site import page_files, page_of_run
from polarsim.formats import png
from polarsim.run_files.run import Run

from .made_run import KEYS

MOST_PACKED = 300_000  # bytes of the page without the run's data


@pytest.fixture(scope="module")
def page():
    return {name: content() for name, content in page_files().items()}


def test_the_page_is_small(page):
    assert sum(len(gzip.compress(content)) for content in page.values()) < MOST_PACKED


def test_the_page_has_no_external_references(page):
    for name, content in page.items():
        if not name.startswith("vendor/"):
            outside = set(re.findall(r"(?:https?:)?//[a-z][\w.-]+\.[a-z]{2,}", content.decode()))
            assert outside <= {"//www.w3.org", "http://www.w3.org"}, name  # names of SVG, never asked


def test_every_imported_module_exists(page):
    for name, content in page.items():
        if name.endswith(".js") and "/" not in name:
            wanted = re.findall(r"from '\./([\w.]+)'", content.decode())
            assert set(wanted) <= set(page), name
    html = page["index.html"].decode()
    assert set(re.findall(r'(?:src|href)="([^"#]+)"', html)) <= set(page)


def test_third_party_files_have_a_licence(page):
    libraries = [name for name in page if name.startswith("vendor/") and name.endswith(".js")]
    assert libraries
    for name in libraries:
        licence = page[name.replace(".min.js", ".LICENSE.txt")].decode()
        assert "Copyright" in licence


def test_the_page_written_by_the_command_equals_the_served_page(polarsim, made, tmp_path):
    call = ("explore", made.name, "--results", made.parent, "--out", tmp_path / "page", "--width", 320)
    done = polarsim(*call)
    assert done.returncode == 0, done.stderr
    files = page_of_run(Run.at(made), 320)
    written = {str(path.relative_to(tmp_path / "page")) for path in (tmp_path / "page").rglob("*") if path.is_file()}
    assert written == set(files)
    assert {name.rpartition(".")[2] for name in files} <= set(TYPES)
    for name in ("index.html", "data/run.json", "data/pictures.arrow", f"data/pictures/photo/{KEYS[0]}.jpg"):
        assert (tmp_path / "page" / name).read_bytes() == files[name]()
    (tmp_path / "page/mine.txt").write_text("mine")
    assert polarsim(*call).returncode == 1  # existing files are not overwritten
    assert (tmp_path / "page/mine.txt").read_text() == "mine"
    done = polarsim("explore", "nothing", "--results", made.parent)
    assert done.returncode == 1
    assert re.fullmatch(r"error: \S*: no run 'nothing'; existing runs: made.*\n", done.stderr)


def test_images_preserve_ratios_of_light(made, tmp_path):
    """The tone curve is fixed: half the light gives a code lower by a factor of 2 ** (1 / 2.2)."""
    files, key = (
        page_of_run(Run.at(made), 242),
        next(key for key in KEYS if key.exposure_ms == 64 and key.azimuth == "30"),
    )
    values = {}
    for domain, gain in (("photo", 2.0), ("hapke", 1.8)):
        (tmp_path / "a.jpg").write_bytes(files[f"data/pictures/{domain}/{key}.jpg"]())
        values[domain] = (png.read_png(tmp_path / "a.jpg")[5, 5] / 255) ** 2.2 * 4079
        assert values[domain] == pytest.approx(gain * 64, rel=0.03)
