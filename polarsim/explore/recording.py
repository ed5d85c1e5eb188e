"""Rerun recording of a station: terrain, cameras, lamps, and the photos with twins and labels for each lamp."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pandas as pd

from polarsim.errors import ConfigError
from polarsim.explore.outlines import of_photos
from polarsim.explore.pictures import jpeg
from polarsim.explore.tables import EDGES
from polarsim.explore.terrain import thinned_terrain
from polarsim.formats.files import writing
from polarsim.geometry.camera import Camera
from polarsim.photo import CAMERAS, COLOURS, NO_ROCK, REFERENCE_EXPOSURE_MS, ROCK, SHADOW, WIDTH, PhotoKey, by_bracket
from polarsim.run_files import lamps, rigs
from polarsim.run_files.run import PHOTO, Run

TIMELINE = "lamp"
PICTURE_PX = 800  # width of the images
CLASSES = {ROCK: (1, COLOURS[ROCK]), SHADOW: (2, COLOURS[SHADOW])}  # class and colour
SAND, ROCKS = (150, 144, 132), (196, 176, 140)


def write_recording(run: Run, terrain: int, position: str, out: Path) -> int:
    """Write the recording (.rrd) of a station; return the number of images.

    The timeline `lamp` has a step for each light and azimuth, with the exposure nearest to 256 ms.

    Raises
    ------
    ConfigError
        Rerun is not installed, or the run has no such station.
    """
    rerun = _rerun()
    shown = list(_shown(run, terrain, position))
    folder = run.folder / "cameras" / f"Terrain{terrain:02d}"
    localised = rigs.read_all_localised(folder) if folder.exists() else {}
    if not shown or position not in localised:
        known = sorted({f"{key.terrain:02d}_{key.position}" for _, key in run.pictures})
        raise ConfigError(
            f"no images and cameras of station {terrain:02d}_{position}, expected one of {', '.join(known)}"
        )
    recording = rerun.RecordingStream("polarsim", recording_id=f"{run.name}_{terrain:02d}_{position}")
    with writing(out) as temporary:
        recording.save(str(temporary), default_blueprint=_blueprint(run))
        recording.log("world", rerun.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
        context = [(number, kind, colour) for kind, (number, colour) in CLASSES.items()]
        recording.log("/", rerun.AnnotationContext(context), static=True)
        _log_terrain(rerun, recording, run, terrain)
        suns = lamps.read_suns(folder, localised)
        names = [f"Sun lamp {azimuth}" for azimuth in suns]
        points = rerun.Points3D(np.array(list(suns.values())), labels=names, radii=0.05, colors=(255, 240, 140))
        recording.log("world/lamps", points, static=True)
        for side in CAMERAS:
            _log_camera(rerun, recording, side, localised[position].camera(side))
        labels = run.labels(terrain)
        for step, key in shown:
            recording.set_time(TIMELINE, sequence=step)
            _log_photo(rerun, recording, run, key, labels[labels["key"] == str(key)])
        recording.flush()
        recording.disconnect()
    return sum((domain, key) in run.pictures for _, key in shown for domain in run.domains)


def _rerun() -> ModuleType:
    try:
        import rerun
    except ImportError as error:
        raise ConfigError("Rerun is not installed: pip install polarsim[rerun]") from error
    module: ModuleType = rerun
    return module


def _shown(run: Run, terrain: int, position: str) -> Iterator[tuple[int, PhotoKey]]:
    """Yield the steps of the timeline with the photos of both cameras."""
    of_station = {key for _, key in run.pictures if key.station == (terrain, position)}
    steps: dict[tuple[str, str], int] = {}
    for (*_, light, azimuth, _camera), keys in by_bracket(of_station).items():
        step = steps.setdefault((light, azimuth), len(steps))
        yield step, min(keys, key=lambda key: (key.stops_off_usual, -key.exposure_ms))


def _blueprint(run: Run) -> Any:
    import rerun.blueprint as parts

    views = [
        parts.Spatial2DView(origin=f"world/{side}", contents=[f"+ world/{side}/{domain}/**"], name=f"{side} {domain}")
        for side in CAMERAS
        for domain in run.domains
    ]
    around = parts.Spatial3DView(origin="world", name=f"terrain; {REFERENCE_EXPOSURE_MS} ms")
    # By default, the viewer may play the timeline of log times, which starts without an image.
    time = parts.TimePanel(state="collapsed", timeline=TIMELINE, play_state="paused")
    return parts.Blueprint(
        parts.Horizontal(around, parts.Grid(*views, grid_columns=len(views) // 2)), time, collapse_panels=True
    )


def _log_terrain(rerun: ModuleType, recording: Any, run: Run, terrain: int) -> None:
    tables = thinned_terrain(run, terrain)
    if tables is None:
        return
    vertices, faces = tables
    rock = vertices["rock"].to_numpy()
    colours = np.where((rock == NO_ROCK)[:, None], SAND, ROCKS).astype(np.uint8)
    mesh = rerun.Mesh3D(
        vertex_positions=vertices[["x", "y", "z"]].to_numpy(np.float32),
        vertex_normals=vertices[["nx", "ny", "nz"]].to_numpy(np.float32),
        triangle_indices=faces.to_numpy(np.uint32),
        vertex_colors=colours,
    )
    recording.log("world/terrain", mesh, static=True)
    tops = vertices[rock != NO_ROCK].groupby("rock")[["x", "y", "z"]].agg({"x": "mean", "y": "mean", "z": "max"})
    names = [str(number) for number in tops.index]
    if names:
        recording.log("world/rocks", rerun.Points3D(tops.to_numpy(), labels=names, radii=0.01), static=True)


def _log_camera(rerun: ModuleType, recording: Any, side: str, camera: Camera) -> None:
    """Log the pinhole camera of the scaled images; lens distortion is ignored."""
    pose, small = camera.world_from_camera, camera.scaled(PICTURE_PX / WIDTH).lens
    recording.log(f"world/{side}", rerun.Transform3D(translation=pose.translation, mat3x3=pose.rotation), static=True)
    pinhole = rerun.Pinhole(
        image_from_camera=small.opencv_matrix(), width=small.width, height=small.height, image_plane_distance=0.6
    )
    recording.log(f"world/{side}", pinhole, static=True)


def _log_photo(rerun: ModuleType, recording: Any, run: Run, key: PhotoKey, labels: pd.DataFrame) -> None:
    scale = PICTURE_PX / WIDTH
    for domain in run.domains:
        path = run.pictures.get((domain, key))
        if path is not None:
            content = jpeg(path, PICTURE_PX)
            recording.log(f"world/{key.camera}/{domain}", rerun.EncodedImage(contents=content, media_type="image/jpeg"))
    corners = labels[EDGES].to_numpy(float) * scale
    boxes = rerun.Boxes2D(
        array=corners,
        array_format=rerun.Box2DFormat.XYXY,
        labels=[f"{rock} {share:.2f}" for rock, share in zip(labels["rock"], labels["confidence"], strict=True)],
        class_ids=[CLASSES[kind][0] for kind in labels["kind"]],
    )
    recording.log(f"world/{key.camera}/{PHOTO}/boxes", boxes)
    polygons = run.polygons(key)
    if polygons.exists():
        rings = of_photos(polygons)
        lines = [np.array([*ring["ring"], *ring["ring"][:2]], float).reshape(-1, 2) * scale for ring in rings]
        outlines = rerun.LineStrips2D(lines, class_ids=[CLASSES[ring["kind"]][0] for ring in rings])
        recording.log(f"world/{key.camera}/{PHOTO}/masks", outlines)
    recording.log("photo", rerun.TextLog(str(key)))
