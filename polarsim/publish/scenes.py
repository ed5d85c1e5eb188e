"""glTF and OpenUSD scenes of terrains with rock ids, cameras and lamps."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from polarsim.formats import gltf, obj
from polarsim.formats.tables import read_parquet
from polarsim.geometry.camera import Camera
from polarsim.geometry.lens import Lens
from polarsim.photo import NO_ROCK, ROCK, terrain_text
from polarsim.publish.bundle import Bundle
from polarsim.publish.catalogue import Catalogue, CatalogueTerrain
from polarsim.publish.reconstruction import CV_FROM_GL

NEAR, FAR = 0.05, 100.0  # clipping distances of cameras, metres
FOCAL = 20.0  # focal length of USD cameras; only the ratio to the aperture matters
LAMP_RADIUS = 0.02  # metres; lamps are rendered as points


def write_gltf(catalogue: Catalogue, bundle: Bundle) -> None:
    """Write `terrainNN.glb`: ground and rocks as named nodes, cameras and lamps; +Y up as required by glTF."""
    for terrain in _meshed(catalogue):
        parts = {_name(rock): obj.read_obj(path) for rock, path in terrain.meshes.items()}
        extras = {_name(rock): _attributes(terrain, rock) for rock in terrain.meshes}
        bundle.make(
            gltf.name(terrain.number),
            partial(
                gltf.write_glb,
                parts=parts,
                support=_support(terrain),
                extras=extras,
                finish=_cameras_and_lamps(terrain),
            ),
        )


def _support(terrain: CatalogueTerrain) -> dict[str, np.ndarray]:
    """Return the support of each vertex by scans, by node; empty if the run has no table of support."""
    path = next(iter(terrain.meshes.values())).with_name("support.parquet")
    if not path.is_file():
        return {}
    table = read_parquet(path, ["mesh", "vertex", "support"])
    by_file = {str(name): rows.sort_values("vertex")["support"].to_numpy() for name, rows in table.groupby("mesh")}
    return {_name(rock): by_file[file.name] for rock, file in terrain.meshes.items() if file.name in by_file}


def _attributes(terrain: CatalogueTerrain, rock: int) -> dict[str, Any]:
    identity = {"terrain": terrain.number, "class": "ground" if rock == NO_ROCK else ROCK, "rock_id": rock}
    return identity | {"made_from": terrain.made_from.get(terrain.meshes[rock].name, ""), "origin": "fitted"}


def _name(rock: int) -> str:
    return gltf.GROUND_NODE if rock == NO_ROCK else f"rock{rock}"


def _meshed(catalogue: Catalogue) -> Iterator[CatalogueTerrain]:
    return (terrain for terrain in catalogue.terrains.values() if terrain.meshes)


def _cameras(terrain: CatalogueTerrain) -> Iterator[tuple[str, str, Camera]]:
    """Yield name, tripod position and camera."""
    for position, localised in sorted(terrain.rigs.items()):
        for side in localised.rig.sides:
            yield f"Pos{position}_Cam{side}", position, localised.camera(side)


def _lamps(terrain: CatalogueTerrain) -> Iterator[tuple[str, np.ndarray, str]]:
    """Yield name, position and origin of each lamp."""
    for azimuth, sun in terrain.suns.items():
        yield f"sun_{azimuth}", sun, terrain.sun_origin(azimuth)
    for position, place, origin in terrain.rig_lamps:
        yield f"rover_light_{position}", place, origin


def lens_extras(lens: Lens) -> dict[str, Any]:
    """Return lens parameters missing in glTF and USD cameras, such as distortion; pixel centres at integer + 0.5."""
    names = ("k1", "k2", "p1", "p2", "k3")
    return {
        "fx_px": lens.fx,
        "fy_px": lens.fy,
        "cx_px": lens.cx,
        "cy_px": lens.cy,
        "width_px": lens.width,
        "height_px": lens.height,
        **dict(zip(names, lens.distortion, strict=True)),
    }


def _cameras_and_lamps(terrain: CatalogueTerrain) -> Any:
    """Return a function that adds cameras and lamps to the JSON of a glTF file; camera frame as in OpenGL."""

    def add(tree: dict[str, Any]) -> None:
        cameras, lamps, nodes = [], [], []
        for name, position, camera in _cameras(terrain):
            lens = camera.lens
            view = {"yfov": 2 * np.arctan(lens.height / 2 / lens.fy), "znear": NEAR, "zfar": FAR}
            view["aspectRatio"] = lens.width / lens.fx * lens.fy / lens.height
            cameras.append({"name": name, "type": "perspective", "perspective": view, "extras": lens_extras(lens)})
            matrix = gltf.Y_UP_FROM_SANDBOX @ camera.world_from_camera.matrix @ CV_FROM_GL
            extras = {"origin": terrain.pose_origin(position)}
            nodes.append(
                {"name": name, "camera": len(cameras) - 1, "matrix": matrix.T.ravel().tolist(), "extras": extras}
            )
        for name, lamp_position, origin in _lamps(terrain):
            lamps.append({"name": name, "type": "point"})
            moved = gltf.Y_UP_FROM_SANDBOX[:3, :3] @ lamp_position
            light = {"KHR_lights_punctual": {"light": len(lamps) - 1}}
            node = {"name": name, "translation": moved.tolist(), "extensions": light}
            nodes.append(node | {"extras": {"origin": origin}})
        first = len(tree["nodes"])
        tree["nodes"] += nodes
        tree["scenes"][0]["nodes"] += list(range(first, first + len(nodes)))
        if cameras:
            tree["cameras"] = cameras
        if lamps:
            tree.setdefault("extensions", {})["KHR_lights_punctual"] = {"lights": lamps}
            tree.setdefault("extensionsUsed", []).append("KHR_lights_punctual")

    return add


def write_usd(catalogue: Catalogue, bundle: Bundle) -> None:
    """Write `terrainNN.usdc`: meshes with semantic labels, cameras, lamps; metres, +Z up, sandbox frame."""
    for terrain in _meshed(catalogue):
        bundle.make(f"terrain{terrain_text(terrain.number)}.usdc", partial(_write_stage, terrain))


def _write_stage(terrain: CatalogueTerrain, path: Path) -> None:
    from pxr import Usd, UsdGeom

    stage = Usd.Stage.CreateNew(str(path))
    UsdGeom.SetStageUpAxis(stage, UsdGeom.Tokens.z)
    UsdGeom.SetStageMetersPerUnit(stage, 1.0)
    world = UsdGeom.Xform.Define(stage, "/World")
    stage.SetDefaultPrim(world.GetPrim())
    for rock, file in terrain.meshes.items():
        _add_mesh(stage, terrain, rock, file)
    for name, position, camera in _cameras(terrain):
        _add_camera(stage, name, camera, terrain.pose_origin(position))
    for name, lamp_position, origin in _lamps(terrain):
        _add_lamp(stage, name, lamp_position, origin)
    stage.GetRootLayer().Save()


def _add_mesh(stage: Any, terrain: CatalogueTerrain, rock: int, file: Path) -> None:
    from pxr import Gf, Sdf, UsdGeom, UsdSemantics, Vt

    mesh = obj.read_obj(file)
    prim = UsdGeom.Mesh.Define(stage, f"/World/{_name(rock)}")
    points = mesh.vertices.astype(np.float32)
    prim.CreatePointsAttr(Vt.Vec3fArray.FromNumpy(points))
    prim.CreateFaceVertexCountsAttr(Vt.IntArray.FromNumpy(np.full(len(mesh.faces), 3, np.int32)))
    prim.CreateFaceVertexIndicesAttr(Vt.IntArray.FromNumpy(mesh.faces.astype(np.int32).ravel()))
    prim.CreateNormalsAttr(Vt.Vec3fArray.FromNumpy(mesh.normals().astype(np.float32)))
    prim.SetNormalsInterpolation(UsdGeom.Tokens.vertex)
    prim.CreateSubdivisionSchemeAttr(UsdGeom.Tokens.none)
    low, high = (Gf.Vec3f(*map(float, corner)) for corner in (points.min(axis=0), points.max(axis=0)))
    prim.CreateExtentAttr([low, high])
    colour = (gltf.SAND_COLOUR if rock == NO_ROCK else gltf.ROCK_COLOUR) / 255
    prim.CreateDisplayColorAttr([Gf.Vec3f(*map(float, colour))])
    attributes = _attributes(terrain, rock)
    labels = {"class": attributes["class"]} | ({"rock_id": str(rock)} if rock != NO_ROCK else {})
    for taxonomy, value in labels.items():
        UsdSemantics.LabelsAPI.Apply(prim.GetPrim(), taxonomy).CreateLabelsAttr([value])
    _set_attributes(prim, {"origin": attributes["origin"], "made_from": attributes["made_from"]}, Sdf)


def _add_camera(stage: Any, name: str, camera: Camera, origin: str) -> None:
    """Add a camera with apertures in the unit of the focal length and aperture offsets for the principal point."""
    from pxr import Gf, Sdf, UsdGeom

    lens = camera.lens
    width, height = FOCAL * lens.width / lens.fx, FOCAL * lens.height / lens.fy
    prim = UsdGeom.Camera.Define(stage, f"/World/{name}")
    prim.CreateProjectionAttr(UsdGeom.Tokens.perspective)
    prim.CreateFocalLengthAttr(FOCAL)
    prim.CreateHorizontalApertureAttr(width)
    prim.CreateVerticalApertureAttr(height)
    prim.CreateHorizontalApertureOffsetAttr(width * (0.5 - lens.cx / lens.width))
    prim.CreateVerticalApertureOffsetAttr(height * (lens.cy / lens.height - 0.5))
    prim.CreateClippingRangeAttr(Gf.Vec2f(NEAR, FAR))
    matrix = camera.world_from_camera.matrix @ CV_FROM_GL
    prim.AddTransformOp().Set(Gf.Matrix4d(*matrix.T.ravel().tolist()))  # USD has row vectors
    _set_attributes(prim, {"origin": origin}, Sdf)
    for key, value in lens_extras(lens).items():
        kind = Sdf.ValueTypeNames.Double
        prim.GetPrim().CreateAttribute(f"polarsim:{key}", kind, custom=True).Set(float(value))


def _add_lamp(stage: Any, name: str, position: np.ndarray, origin: str) -> None:
    from pxr import Gf, Sdf, UsdGeom, UsdLux

    lamp = UsdLux.SphereLight.Define(stage, f"/World/{name}")
    lamp.CreateRadiusAttr(LAMP_RADIUS)
    lamp.CreateTreatAsPointAttr(True)
    UsdGeom.Boundable(lamp).CreateExtentAttr([Gf.Vec3f(-LAMP_RADIUS), Gf.Vec3f(LAMP_RADIUS)])
    UsdGeom.Xformable(lamp).AddTranslateOp().Set(Gf.Vec3d(*map(float, position)))
    _set_attributes(lamp, {"origin": origin}, Sdf)


def _set_attributes(prim: Any, texts: dict[str, str], sdf: Any) -> None:
    for key, text in texts.items():
        prim.GetPrim().CreateAttribute(f"polarsim:{key}", sdf.ValueTypeNames.Token, custom=True).Set(text)
