"""Commands that render scenes and compute reflectance."""

from __future__ import annotations

import shlex
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from polarsim.arguments import PLOTS, refuse_existing_folder, sun_above_horizon, writes_file, writes_folder
from polarsim.cli.application import DEFAULT, SiteName, assignments, commands_of
from polarsim.render.models import Model

if TYPE_CHECKING:
    import numpy as np

command = commands_of("Rendering")


@command()
def render(
    context: typer.Context,
    meshes: Annotated[
        Path | None,
        typer.Argument(
            metavar="MESHES|VIEWS.yaml",
            help="Folder of terrain meshes, results/<run>/meshes/TerrainNN; or a file of views for many images, for "
            "example config/views.yaml.",
        ),
    ] = None,
    out: Annotated[
        Path | None,
        typer.Argument(help="16-bit PNG to write (12-bit values, black level 16); for a file of views: a folder."),
    ] = None,
    demo: Annotated[
        bool,
        typer.Option(
            "--demo",
            help="Render a generated rock scene, without a run: both models under four Suns, to the folder of the "
            "first argument (default: render_demo).",
        ),
    ] = False,
    terrain: Annotated[str | None, typer.Option(help="Terrain number or name; default: from the meshes.")] = None,
    site: SiteName = DEFAULT,
    camera: Annotated[
        tuple[float, float, float] | None,
        typer.Option(
            help="Camera centre x y z, m, sandbox frame; default of --camera, --yaw and --pitch: the first surveyed "
            "position of the site."
        ),
    ] = None,
    yaw: Annotated[float | None, typer.Option(help="Heading of the optical axis, deg from +X towards +Y.")] = None,
    pitch: Annotated[
        float | None, typer.Option(min=-90, max=90, help="Downward angle of the optical axis, deg.")
    ] = None,
    roll: Annotated[float, typer.Option(help="Rotation about the optical axis, right side down, deg.")] = 0.0,
    lamp: Annotated[
        tuple[float, float, float] | None,
        typer.Option(help="Sun lamp x y z, m, sandbox frame; default: the first lamp of the site."),
    ] = None,
    intensity: Annotated[float, typer.Option(min=0, help="Radiant intensity relative to the Sun lamp of POLAR.")] = 1.0,
    lamp_radius: Annotated[float, typer.Option(min=0, help="Radius of the lamp disc, m; 0: point light.")] = 0.0,
    sun: Annotated[
        tuple[float, float] | None,
        typer.Option(
            callback=sun_above_horizon,
            help="Directional light instead of the lamp: azimuth from +X towards +Y and elevation, deg.",
        ),
    ] = None,
    exposure: Annotated[
        float | None, typer.Option(min=0, help="Exposure time, ms; default: the usual exposure of the site.")
    ] = None,
    model: Annotated[Model, typer.Option(help="Reflectance model.")] = "hapke",
    engine: Annotated[
        Literal["numpy", "taichi"] | None, typer.Option(help="Shading engine; default: from the configuration.")
    ] = None,
    option: Annotated[
        list[str] | None,
        typer.Option(
            callback=assignments,
            metavar="KEY=VALUE",
            help="Key of the configuration section `render`, for example samples=4; may be repeated.",
        ),
    ] = None,
    cameras: Annotated[
        Path | None, typer.Option(help="PosX.json with the left lens; default: nominal lens of the rig.")
    ] = None,
    preview: Annotated[bool, typer.Option("--preview", help="Write an 8-bit tone-mapped PNG instead.")] = False,
    maps: Annotated[
        Path | None,
        typer.Option(
            callback=writes_folder,
            help="Folder for 16-bit PNGs: depth (mm), normal, ids, angles (0.01 deg), shading, lit.",
        ),
    ] = None,
    threads: Annotated[int, typer.Option(min=1, help="Number of threads. Does not affect the output.")] = 1,
    limit: Annotated[int | None, typer.Option(min=1, help="For a file of views: maximum number of images.")] = None,
    scale: Annotated[
        float, typer.Option(min=0.01, max=4, help="For a file of views and --demo: image size relative to the lens.")
    ] = 1.0,
) -> None:
    """Render one image of a terrain, or the labelled images of a file of views or of the demonstration (--demo).

    Writes a JSON file with the parameters next to each image.
    """
    if demo:
        _refuse_others(context, {"demo", "meshes", "scale", "threads"})
        folder = meshes or Path("render_demo")
        writes_folder(folder)
        _render_demo(folder, scale, threads)
        return
    if meshes is None or out is None:
        raise typer.BadParameter("expected MESHES|VIEWS.yaml and OUT, or --demo")
    if meshes.suffix in (".yaml", ".yml"):
        _refuse_others(context, {"meshes", "out", "limit", "scale", "threads", "preview"})
        writes_folder(out)
        _render_views(meshes, out, limit, scale, preview, threads)
        return
    _refuse_others(context, set(context.params) - {"limit", "scale", "demo"})
    import numpy as np

    from polarsim.config import render_options
    from polarsim.errors import ConfigError
    from polarsim.formats import png
    from polarsim.formats.calibrations import stated_rig
    from polarsim.geometry.camera import Camera
    from polarsim.geometry.poses import camera_pose
    from polarsim.photo import parse_terrain
    from polarsim.render.lamps import Lamp, first_lamp, first_tripod
    from polarsim.render.maps import write_maps
    from polarsim.render.scene import Scene, Shot
    from polarsim.render.sidecar import write_sidecar
    from polarsim.run_files.rigs import read_localised
    from polarsim.run_files.scene import terrain_of_folder
    from polarsim.site import read_site
    from polarsim.tone import to_8bit

    writes_file(".png")(out)
    sidecar = out.with_suffix(".json")
    refuse_existing_folder(sidecar)
    chosen = read_site(site)
    if cameras is None and chosen.cameras.calibration is None:
        raise ConfigError(
            f"the site {chosen.name} has a calibration per terrain: add --cameras with the lens of a position, such as "
            "results/RUN/cameras/TerrainNN/PosX.json"
        )
    rig = read_localised(cameras).rig if cameras else stated_rig(chosen)
    tripod = first_tripod(chosen)
    centre = np.array(camera or tripod.camera_m)
    heading = tripod.yaw_deg if yaw is None else yaw
    downward = tripod.pitch_deg if pitch is None else pitch
    near = Lamp(np.array(lamp)) if lamp else first_lamp(chosen)
    near = replace(near, intensity=near.intensity * intensity, radius_m=lamp_radius)
    shot = Shot(
        camera=Camera(camera_pose(centre, *np.radians([heading, downward, roll])), rig.left),
        lamps={"sun": Lamp.sun(*sun, intensity) if sun else near},
        exposure_ms=float(chosen.usual_exposure_ms) if exposure is None else exposure,
        model=model,
    )
    assignments = [*(option or ()), *([f"engine={engine}"] if engine else ())]
    found = parse_terrain(terrain) if terrain else terrain_of_folder(meshes)
    scene = Scene(meshes, found, render_options(assignments), chosen)
    scene.refuse_positions(shot)
    picture = scene.picture(shot, threads)
    png.write_png(out, to_8bit(picture) if preview else picture)
    write_sidecar(sidecar, scene.sidecar(shot))
    if maps:
        write_maps(maps, scene.maps(shot, threads))
    typer.echo(str(out))


@command()
def brdf(
    model: Annotated[Model, typer.Argument(help="Reflectance model.")],
    incidence: Annotated[float, typer.Option(min=0, max=90, help="Incidence angle, deg from the normal.")] = 30.0,
    emergence: Annotated[float, typer.Option(min=0, max=90, help="Emergence angle, deg from the normal.")] = 0.0,
    azimuth: Annotated[
        float,
        typer.Option(
            min=0, max=180, help="Relative azimuth of light and viewer, deg; 0: same side, 180: opposite sides."
        ),
    ] = 0.0,
    soil: Annotated[
        str | None, typer.Option("--set", help="Parameter set of the Hapke models; default: chrono_lunar.")
    ] = None,
    plot: Annotated[
        Path | None,
        typer.Option(
            callback=writes_file(*PLOTS),
            help="Figure of the reflectance over the phase angle, for every parameter set unless --set is given.",
        ),
    ] = None,
) -> None:
    """Print the BRDF value f_r in 1/sr and the reflectance factor pi f_r (1: ideal white Lambertian surface)."""
    import numpy as np

    from polarsim.render.goniometer import parameters_of, phase_deg, reflectance_at, reflectance_panels
    from polarsim.render.parameters import HAPKE_SETS

    angles = (np.array([incidence]), np.array([emergence]), np.array([azimuth]))
    value = reflectance_at(parameters_of(model, soil), *angles)[0]
    typer.echo(f"phase   {phase_deg(*angles)[0]:.6g} deg")
    typer.echo(f"f_r     {value:.6g} 1/sr")
    typer.echo(f"pi f_r  {np.pi * value:.6g}")
    if plot:
        from polarsim.report.figures.brdf import draw_brdf

        names = list(HAPKE_SETS) if soil is None and model in ("hapke", "hapke_chrono") else [soil]
        chosen = {name or model: parameters_of(model, name) for name in names}
        draw_brdf(plot, reflectance_panels(chosen, incidence))
        typer.echo(str(plot))


def _render_demo(out: Path, scale: float, threads: int) -> None:
    from polarsim.cli.demo_views import render_demo

    count, sheet = render_demo(out, tone=_same_white(), scale=scale, threads=threads)
    typer.echo(f"{sheet}: {count} images of one scene with labels; image files: {out / 'views/images'}")
    meshes = shlex.quote(str(out / "meshes"))
    typer.echo(f"next:  polarsim render {meshes} mine.png --sun 60 5 --preview   (your own Sun)")
    typer.echo("       make demo   (the whole pipeline: photos, meshes, labels, twins, detectors)")


def _same_white() -> Callable[[np.ndarray], np.ndarray]:
    """Return the conversion to 8 bits with the same white level for all images, which keeps exposures comparable."""
    from polarsim.photo import BLACK_LEVEL, WHITE_LEVEL
    from polarsim.tone import to_8bit

    return partial(to_8bit, white=WHITE_LEVEL - BLACK_LEVEL)


def _render_views(file: Path, out: Path, limit: int | None, scale: float, preview: bool, threads: int) -> None:
    from polarsim.render.views.options import read_views
    from polarsim.render.views.run import render_views

    count = render_views(
        read_views(file), out, tone=_same_white(), limit=limit, scale=scale, preview=preview, threads=threads
    )
    typer.echo(f"{count} labelled pictures in {out}; overview: {out / 'contact.jpg'}")


def _refuse_others(context: typer.Context, known: set[str]) -> None:
    """Raise `BadParameter` for an option that does not apply to a single image or to a file of views."""
    for name in context.params:
        source = context.get_parameter_source(name)
        if name not in known and source is not None and source.name == "COMMANDLINE":
            form = "--demo" if "demo" in known else "one picture" if "limit" not in known else "a file of views"
            raise typer.BadParameter(f"--{name.replace('_', '-')} does not apply to {form}")
