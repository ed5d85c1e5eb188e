"""Plans of a site with named terrains: two cameras, one camera, no scans; and errors of one line."""

import pytest

from tests.workflow.conftest import planned

YARD = ("--configfile", "config/yard.yaml")
DETECTORS = "detect={run: true, stereo: {run: true}, others: {}}"


@pytest.fixture
def single(checkout):
    """A checkout in which the yard has a single camera."""
    site = checkout / "config/sites/single.yaml"
    text = (checkout / "config/sites/yard.yaml").read_text()
    site.write_text(text.replace("  baseline_m: [0.11, 0.13]", "  stereo: false #"))
    return checkout


def test_a_plan_has_the_terrains_and_positions_of_the_site(dry_run):
    done = dry_run(*YARD)
    jobs, text = planned(done), done.stdout + done.stderr
    stages = ("generate_analog", "locate_cameras", "find_rocks", "propagate_labels", "render_twins", "score_labels")
    assert [jobs[name] for name in (*stages, "draw_photos", "draw_geometry")] == [2] * 8
    assert jobs["write_results_page"] == 1
    assert "results/yard/figures/contact_Terrainyard-b_Posnorth.png" in text
    assert "measure_ranges" not in jobs


def test_stereo_depth_is_planned_only_with_two_cameras(dry_run, snakemake, single):
    with_two = planned(dry_run(*YARD, "--config", DETECTORS))
    one = snakemake(single, "--dry-run", *YARD, "--config", DETECTORS, f"site={single / 'config/sites/single.yaml'}")
    with_one = planned(one)
    assert (with_two["measure_stereo"], with_two["compare_stereo"], with_two["tabulate_stereo"]) == (2, 1, 1)
    assert set(with_two) - set(with_one) == {"measure_stereo", "compare_stereo", "tabulate_stereo"}
    assert "site yard: stereo: not possible, one camera" in one.stdout + one.stderr


def test_without_scans_ranges_are_measured_in_stereo_photos(dry_run, snakemake, single):
    jobs = planned(dry_run(*YARD, "--config", "source={scans: false}"))
    assert jobs["measure_ranges"] == 2
    done = snakemake(
        single, "--dry-run", *YARD, "--config", "source={scans: false}", f"site={single / 'config/sites/single.yaml'}"
    )
    assert done.returncode != 0
    (line,) = [line for line in (done.stdout + done.stderr).splitlines() if line.startswith("error:")]
    assert "one camera" in line
