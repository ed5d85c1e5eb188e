"""Figure of cover photos next to their twins."""

import numpy as np

from polarsim.formats import png
from polarsim.formats.tables import label_table, write_parquet
from polarsim.photo import PhotoKey
from polarsim.report.figures import real_pairs
from tests.support.label_rows import label_row

KEY = PhotoKey.parse("03_A_off_30_L_0256")


def test_only_photos_are_titled_with_their_key(tmp_path, monkeypatch):
    """Keys above all columns overlapped with three models and the control."""
    titles = []
    monkeypatch.setattr(real_pairs, "show_image", lambda axes, pixels, title: titles.append(title))
    domains = ("real", "principled", "hapke")
    for domain in domains:
        png.write_png(tmp_path / f"{domain}/{KEY}.png", np.full((122, 194), 90, np.uint8))
        write_parquet(tmp_path / f"{domain}.parquet", label_table([label_row(KEY, "rock", 1, (10, 10, 50, 40))]))
    real_pairs.draw_real_pairs(
        pictures={domain: tmp_path / domain for domain in domains},
        labels={domain: tmp_path / f"{domain}.parquet" for domain in domains},
        figure=tmp_path / "pairs.png", width=600,
    )  # fmt: skip
    assert titles == [f"Real, {KEY}", "Principled", "Hapke"]
