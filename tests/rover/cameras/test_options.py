"""The paper's views."""

from polarsim.rover.cameras.options import PAPER_VIEWS
from tests.rover import driven


def test_the_paper_has_seven_views_and_the_table_knows_them_all():
    assert len(PAPER_VIEWS) == 7
    for name in PAPER_VIEWS:
        assert driven.vehicle().camera(name).name == name
