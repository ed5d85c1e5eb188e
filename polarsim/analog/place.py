"""Where a generated terrain lies below the analog's root, and the receipt that says it is complete."""

from __future__ import annotations

from pathlib import Path

from polarsim.analog.generate import generate_terrain
from polarsim.analog.options import AnalogOptions
from polarsim.formats.files import write_json
from polarsim.photo import PhotoKey
from polarsim.survey import terrain_folder


def generate_terrain_at(
    *, root: Path, receipt: Path, terrain: int, keys: list[PhotoKey], options: AnalogOptions, threads: int
) -> None:
    """Generate one terrain in the layout of `docs/formats.md`; the receipt is written last."""
    receipt.unlink(missing_ok=True)
    raw = root / terrain_folder(terrain)
    generate_terrain(
        terrain=terrain,
        keys=keys,
        raw=raw,
        ranges=root / "GroundTruth_RectifiedRangeMaps" / f"Terrain{terrain:02d}",
        seeds=root / "Labels" / f"Terrain{terrain:02d}",
        truth=root / "truth" / f"Terrain{terrain:02d}",
        options=options,
        threads=threads,
    )
    write_json(
        receipt,
        {
            "terrain": terrain,
            "folder": raw.name,
            "photos": sum(1 for _ in raw.rglob("Cam?_*.png")),
            "options": options.model_dump(mode="json"),
        },
    )
