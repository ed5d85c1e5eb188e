"""Simulated photo capture: OLAT images of each view, photos as sums of OLAT images, and labels."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd

from polarsim.analog.annotator import annotate
from polarsim.analog.bounce import AMBIENT, Bounce, gather_bounce
from polarsim.analog.light import DiscLamp, direct, visibility
from polarsim.analog.options import AnalogOptions
from polarsim.analog.raw_files import RawFiles, write_photo
from polarsim.analog.regions import VisibleRegion, region_contrast, rock_regions, shadow_regions
from polarsim.analog.sandbox import GROUND_OBJECT
from polarsim.analog.sensor import (
    ELECTRONS_PER_DN,
    blur_and_vignette,
    expose_raw,
    fixed_pattern,
    lamp_glare,
)
from polarsim.analog.stations import ROVER, Stations
from polarsim.analog.terrain import AnalogTerrain
from polarsim.analog.truth import AlbedoMap, AlbedoSums, albedo_sums
from polarsim.analog.view import Textures, make_textures, render_gbuffer
from polarsim.formats import tables, yolo
from polarsim.photo import BLACK_LEVEL, ROCK, SHADOW, PhotoKey, terrain_text
from polarsim.photo_format import in_photo_format
from polarsim.progress import progress_bar
from polarsim.randomness import generator
from polarsim.site import Site
from polarsim.site_parts import FAR_M, SunLamp

# Photo-electrons per millisecond at unit radiance, for sites with this usual exposure. The sand at the centre of the
# sandbox is then well exposed by a lamp of unit output that causes this irradiance on level sand (NASA's lamp 30).
ELECTRONS, _USUAL_EXPOSURE_MS = 20000.0, 256
_IRRADIANCE = 0.01277  # 1/m2
_ANNOTATED_SHADOWS = 0.5  # minimum exposure of annotated shadows, as a share of the usual exposure
_RIG_LAMP_RADIUS = 0.045  # radius of the disc of the rig's lamp, metres
_SUN_RADIUS = 0.0047  # angular radius of a directional lamp, radians
_HALL_DN_PER_S = 1.2  # brightness of sand in the dark hall
_GLARE = 0.002  # radiance at the centre of lens ghosts
_SAND_ALBEDO = 0.19
_MIN_DN, _MAX_DN = 100, 3000  # DN above black of well exposed sand
_SPARSE = 4  # step between pixels for measuring the exposure of a photo


@dataclass(frozen=True)
class LitView:
    """Linear images of a view by lamp, with the visible regions."""

    images: dict[str, np.ndarray]  # azimuth, ROVER, AMBIENT -> (h, w) float32 radiance
    rocks: list[VisibleRegion]
    shadows: dict[str, list[VisibleRegion]]  # azimuth or ROVER -> regions
    sand: np.ndarray  # (h / _SPARSE, w / _SPARSE) bool

    def lit(self, key: PhotoKey) -> np.ndarray:
        """Return the radiance (h, w) under the lamps of a photo."""
        image = self.images[AMBIENT].copy()
        for lamp in _lamps_of(key):
            image += self.images[lamp]
        return image

    def shadows_of(self, key: PhotoKey) -> list[VisibleRegion]:
        """Return the shadows of the main lamp of a photo: the Sun lamp if on, else the rover light."""
        lamps = _lamps_of(key)
        return self.shadows[lamps[0]] if lamps else []


def _lamps_of(key: PhotoKey) -> list[str]:
    return ([key.azimuth] if key.azimuth != "no" else []) + ([ROVER] if key.light == "on" else [])


def take_photos(
    made: AnalogTerrain,
    site: Site,
    keys: Sequence[PhotoKey],
    raw: RawFiles,
    seeds: Path,
    albedo: AlbedoMap,
    options: AnalogOptions,
    pool: ThreadPoolExecutor,
) -> pd.DataFrame:
    """Write the photos and the seed labels; return the true labels of all photos and add the views to `albedo`.

    Each thread of the pool photographs a view at a time.
    """
    if not keys:
        return _label_table([])
    at = sorted({key.position for key in keys})
    lamps = {position: _lamps(site, made.stations, position) for position in at}
    bounces = gather_bounce(made.scene, made.caster, _named(lamps), generator(options.seed, "bounce", made.terrain))
    textures = make_textures(generator(options.seed, "textures", made.terrain))
    tokens = _tokens(keys, options.seed)
    rows: list[dict[str, object]] = []
    views = [(position, camera) for position in at for camera in site.cameras.sides]

    def photograph(view: tuple[str, str]) -> tuple[list[dict[str, object]], list[AlbedoSums]]:
        here = [key for key in keys if (key.position, key.camera) == view]
        if not here:
            return [], []
        wanted = {lamp: lamps[view[0]][lamp] for lamp in sorted({name for key in here for name in _lamps_of(key)})}
        olat_images, sums = _olat_images(made, *view, wanted, bounces, textures, options)
        return _shoot(site, olat_images, here, tokens, raw, seeds, options), sums

    text = f"views of terrain {terrain_text(made.terrain)}"
    with progress_bar(text) as report:
        for number, (labels, sums) in enumerate(pool.map(photograph, views), 1):
            rows += labels
            albedo.add(sums)
            report(number / len(views))
    return _label_table(rows)


def _lamps(site: Site, stations: Stations, position: str) -> dict[str, DiscLamp]:
    """Return the lamps of a position by azimuth, and the rover light of the position."""
    left = stations.sandbox_from_left[position]
    outputs = _outputs(site)
    lamps = {}
    for name, lamp_position in stations.lamps_at(position).items():
        target = left.apply(np.array([0, 0.0, 4.0])) if name == ROVER else np.zeros(3)
        radius = _RIG_LAMP_RADIUS if name == ROVER else _radius(site.lamps[name])
        lamps[name] = DiscLamp(lamp_position, target, radius, outputs[name])
    return lamps


def _radius(lamp: SunLamp) -> float:
    return FAR_M * _SUN_RADIUS if lamp.kind == "directional" else lamp.radius_m


def _outputs(site: Site) -> dict[str, float]:
    """Return the radiant intensity of the lamps and of the rover light."""
    outputs = {name: site.analog.lamp_output.get(name) or _usual_output(lamp) for name, lamp in site.lamps.items()}
    near = [output for name, output in outputs.items() if site.lamps[name].kind == "point"]
    return outputs | ({ROVER: site.rig_lamp.share * (near or [1.0])[0]} if site.rig_lamp else {})


def _usual_output(lamp: SunLamp) -> float:
    """Return the intensity that causes the usual irradiance on level sand at the centre of the sandbox."""
    distance = float(np.linalg.norm(lamp.point))
    return _IRRADIANCE * distance**3 / max(lamp.point[2], 0.05 * distance)


def _bounce_name(lamp: str, position: str) -> str:
    return f"{lamp}_{position}" if lamp == ROVER else lamp


def _named(lamps: Mapping[str, Mapping[str, DiscLamp]]) -> dict[str, DiscLamp]:
    """Return the lamps of all positions by unique name."""
    return {_bounce_name(name, position): lamp for position in lamps for name, lamp in lamps[position].items()}


def _olat_images(
    made: AnalogTerrain, position: str, camera: str, lamps: Mapping[str, DiscLamp], bounces: Bounce,
    textures: Textures, options: AnalogOptions,
) -> tuple[LitView, list[AlbedoSums]]:  # fmt: skip
    scene, posed = made.scene, made.stations.camera(position, camera)
    view = render_gbuffer(scene, made.caster, textures, posed)
    images, shadows = {}, {}
    hall = _HALL_DN_PER_S * ELECTRONS_PER_DN / 1000 / ELECTRONS / _SAND_ALBEDO
    indirect = bounces.at(scene, view, [AMBIENT, *(_bounce_name(name, position) for name in lamps)])
    images[AMBIENT] = blur_and_vignette(hall * indirect[AMBIENT])
    for name, lamp in lamps.items():
        rng = generator(options.seed, "light", made.terrain, position, camera, name)
        visible = visibility(view, made.caster, lamp, rng)
        lit = direct(view, lamp, visible)
        lit += indirect.pop(_bounce_name(name, position))
        glare = lamp_glare(lamp, posed, _GLARE * lamp.intensity, rng)
        images[name] = blur_and_vignette(lit) + glare
        shadows[name] = shadow_regions(scene, made.caster, made.rock_caster, view, lamp, visible)
    sand = view.objects[::_SPARSE, ::_SPARSE] == GROUND_OBJECT
    return LitView(images, rock_regions(view), shadows, sand), albedo_sums(view)


def _shoot(
    site: Site, olat_images: LitView, keys: Sequence[PhotoKey], tokens: Mapping[tuple[object, ...], str], raw: RawFiles,
    seeds: Path, options: AnalogOptions,
) -> list[dict[str, object]]:  # fmt: skip
    """Write the photos and the seeds of a view; return rows of the true labels."""
    pattern = fixed_pattern(generator(options.seed, "pattern", keys[0].camera), olat_images.images[AMBIENT].shape)
    electrons = ELECTRONS * _USUAL_EXPOSURE_MS / site.usual_exposure_ms
    shadows_from_ms = _ANNOTATED_SHADOWS * site.usual_exposure_ms

    rows: list[dict[str, object]] = []
    best: dict[str, tuple[tuple[bool, float], PhotoKey, np.ndarray]] = {}
    for key in keys:
        rng = generator(options.seed, "sensor", key)
        values = expose_raw(olat_images.lit(key), key.exposure_ms, electrons, rng, pattern, site.images)
        write_photo(raw.photo(key, tokens[_pair(key)]), values, site.images)
        photo = in_photo_format(values, site.images)
        rows += _label_rows(key, olat_images, photo)
        if key.camera != "L" or key.light != "off" or not key.has_sun:
            continue  # never a seed
        sand = photo[::_SPARSE, ::_SPARSE][olat_images.sand].astype(np.int32) - BLACK_LEVEL
        well_exposed = float(((sand > _MIN_DN) & (sand < _MAX_DN)).mean())
        rank = (key.exposure_ms >= shadows_from_ms, well_exposed)  # prefer photos with shadows
        if key.azimuth not in best or rank > best[key.azimuth][0]:
            best[key.azimuth] = rank, key, photo
    for _, key, photo in best.values():
        rng = generator(options.seed, "annotator", key.with_exposure(16))
        with_shadows = key.exposure_ms >= shadows_from_ms
        annotated = annotate(olat_images.rocks, olat_images.shadows_of(key), photo, rng, with_shadows=with_shadows)
        yolo.write_boxes(seeds / f"{key}.txt", *annotated, size=site.images.size)
    return rows


def _label_rows(key: PhotoKey, olat_images: LitView, photo: np.ndarray) -> list[dict[str, object]]:
    regions = [(ROCK, region) for region in olat_images.rocks]
    regions += [(SHADOW, region) for region in olat_images.shadows_of(key)]
    return [
        {
            **tables.key_columns(key), "kind": kind, "rock": region.rock, "source": "truth", "confidence": 1.0,
            **dict(zip(("x0", "y0", "x1", "y1"), map(float, region.box), strict=True)),
            "visible_px": region.pixels, "width_px": region.width_px,
            "contrast": round(region_contrast(region, photo), 2),
        }
        for kind, region in regions
    ]  # fmt: skip


def _label_table(rows: list[dict[str, object]]) -> pd.DataFrame:
    """Return `tables.label_table` with three additional columns of the ground truth."""
    order = sorted(rows, key=lambda row: (str(row["key"]), str(row["kind"]), row["rock"], row["x0"], row["y0"]))
    table = tables.label_table(order)
    for name in ("visible_px", "width_px"):
        table[name] = pd.Series([row[name] for row in order], dtype="int64")
    table["contrast"] = pd.Series([row["contrast"] for row in order], dtype="float64")
    return table


def _pair(key: PhotoKey) -> tuple[object, ...]:
    return key.terrain, key.position, key.light, key.azimuth, key.exposure_ms


def _tokens(keys: Sequence[PhotoKey], seed: int) -> dict[tuple[object, ...], str]:
    """Return the number in the middle of the photo names: unique and random for each stereo pair."""
    tokens: dict[tuple[object, ...], str] = {}
    for pair in sorted({_pair(key) for key in keys}, key=str):
        rng = generator(seed, "token", *pair)
        token = str(rng.integers(100_000_000, 999_999_999))
        while token in tokens.values():
            token = str(rng.integers(100_000_000, 999_999_999))
        tokens[pair] = token
    return tokens
