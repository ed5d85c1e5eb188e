"""The manual."""

import os
from pathlib import Path

import pytest

CHECKOUT = Path(__file__).parents[2]


@pytest.mark.slow
def test_the_site_builds_without_a_warning(server_of, tmp_path):
    """Build all pages as `make docs` does, with generated text and the code of the gallery, in a faster theme."""
    build = ["-W", "--keep-going", "-q", "-b", "html", "-D", "html_theme=basic", str(CHECKOUT / "docs")]
    environment = os.environ | {"PYTHONPATH": str(CHECKOUT)}
    done = server_of(None).call(tmp_path, [*build, str(tmp_path / "site")], environment, module="sphinx")
    assert done.returncode == 0, done.stderr
    site = tmp_path / "site"
    assert "--incidence" in (site / "reference/cli.html").read_text()
    assert "min_contrast_dn" in (site / "reference/configuration.html").read_text()
    assert "sandbox_from_left" in (site / "reference/api-geometry.html").read_text()
    pictures = {path.stem for path in (site / "_images").glob("*.png")}
    assert pictures >= {"lobes", "rock", "bracket", "sum", "outline"}
