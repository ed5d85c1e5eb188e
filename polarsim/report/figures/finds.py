"""What one detector finds in photo and twins, and the rocks that it finds most differently."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path

from polarsim.formats.run_files import picture_finder
from polarsim.formats.tables import read_parquet
from polarsim.report.figures.gap_rocks import draw_gap_rocks
from polarsim.report.figures.seen import draw_seen


def draw_finds(
    *,
    trained: str,
    photo_domain: str,
    pictures: Iterable[Path],
    instances: Path,
    ipd: Path,
    predictions: Mapping[str, Path],
    labels: Mapping[str, Path],
    seen: Path,
    gap_rocks: Path,
    origin: dict[str, str],
) -> None:
    """Write both figures; the least confidence of a prediction is that of the IPD.

    Parameters
    ----------
    photo_domain, pictures
        Tables of photos, the domain that they are of, and folders of twins: see `picture_finder`.
    """
    picture_of, confidence = picture_finder(photo_domain, pictures), _confidence(ipd)
    for draw, figure in ((draw_seen, seen), (draw_gap_rocks, gap_rocks)):
        draw(
            trained=trained,
            instances=instances,
            predictions=predictions,
            labels=labels,
            picture_of=picture_of,
            confidence=confidence,
            figure=figure,
            origin=origin,
        )


def _confidence(ipd: Path) -> float:
    """Least confidence of the predictions that IPD counts."""
    confidence = read_parquet(ipd, ["confidence"])["confidence"]
    return float(confidence.iloc[0]) if len(confidence) else 0.0
