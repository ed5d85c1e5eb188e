"""Surfaces, camera, lamp and reflectance as a Mitsuba 3 scene, for comparison with the renderer of polarsim.

    import mitsuba as mi
    mi.set_variant(variant())
    picture = render(mitsuba_scene(surfaces, pose, lens, lamp, parameters), samples=64)

Scripts in this folder import it as `mitsuba_scene`, tests as `benchmarks.mitsuba_scene`. Mitsuba comes with
`pip install polarsim[mitsuba]`; its LLVM variants need a libLLVM (`libllvm19` is found by itself), `scalar_rgb` none.
"""

from __future__ import annotations

from typing import Any, Literal

import numpy as np

from polarsim.geometry.lens import Lens
from polarsim.geometry.poses import Pose
from polarsim.render.lamps import REFERENCE_DISTANCE, Lamp
from polarsim.render.parameters import LambertParameters, Parameters, PrincipledParameters
from polarsim.render.surfaces import Surfaces
from polarsim.run_files.instances import BACKGROUND

Integrator = Literal["direct", "path"]
_SQUARE = 1e-4  # maximum anisotropy of pixels, because Mitsuba has a single focal length


def variant() -> str:
    """Return the fastest variant of Mitsuba on this CPU."""
    import mitsuba as mi

    try:
        mi.set_variant("llvm_ad_mono")
        import drjit as dr

        dr.eval(mi.Float(0))  # raises without libLLVM
    except (ImportError, RuntimeError):
        return "scalar_rgb"
    return "llvm_ad_mono"


def mitsuba_scene(
    surfaces: Surfaces,
    sandbox_from_camera: Pose,
    lens: Lens,
    lamp: Lamp,
    parameters: Parameters,
    *,
    wall_albedo: float | None = None,
    integrator: Integrator = "direct",
    bounces: int = 0,
) -> dict[str, Any]:
    """Return the scene dictionary (`mi.load_dict`) that corresponds to `render_view`, in the same units of radiance.

    Parameters
    ----------
    lens : Lens
        Without distortion, its pixels square.
    lamp : Lamp
        A point with the inverse square of the distance (`falloff`), or a distant one, then a parallel beam.
    wall_albedo : float or None
        Of walls that are plain diffuse; None: they are like the ground.
    bounces : int
        Of the path integrator: reflections between the lamp's light and the surface that the camera sees.

    Raises
    ------
    ValueError
        Mitsuba has nothing that corresponds.
    """
    walls = surfaces.id_of_face == BACKGROUND
    parts = {"sand": (~walls, bsdf(parameters))}
    if walls.any():
        plain = parameters if wall_albedo is None else LambertParameters(albedo=wall_albedo)
        parts["walls"] = (walls, bsdf(plain))
    depth = {"max_depth": bounces + 2, "rr_depth": 1000} if integrator == "path" else {"bsdf_samples": 0}
    return {
        "type": "scene",
        "integrator": {"type": integrator, **depth},
        "sensor": perspective(sandbox_from_camera, lens),
        "lamp": emitter(lamp),
        **{name: mesh(name, surfaces, chosen, material) for name, (chosen, material) in parts.items()},
    }


def render(scene: dict[str, Any], samples: int, seed: int = 0) -> np.ndarray:
    """Return (h, w) float32 radiance, the mean of random rays per pixel."""
    import mitsuba as mi

    return np.array(mi.render(mi.load_dict(scene), spp=samples, seed=seed))[..., 0]


def bsdf(parameters: Parameters) -> dict[str, Any]:
    """Return the two-sided plugin of a reflectance model.

    Raises
    ------
    ValueError
        Mitsuba has no such model.
    """
    if isinstance(parameters, LambertParameters):
        plain: dict[str, Any] = {"type": "diffuse", "reflectance": grey(parameters.albedo)}
    elif isinstance(parameters, PrincipledParameters):
        plain = {"type": "principled", **parameters.model_dump(exclude={"base_color"})}
        plain["base_color"] = grey(parameters.base_color)
    else:
        raise ValueError(f"Mitsuba has no model like {type(parameters).__name__}, only principled and lambert")
    return {"type": "twosided", "side": plain}


def grey(value: float) -> dict[str, Any]:
    """Return a grey colour."""
    return {"type": "rgb", "value": [value] * 3}


def emitter(lamp: Lamp) -> dict[str, Any]:
    """Return the plugin of a lamp.

    Raises
    ------
    ValueError
        A near lamp that is a disc.
    """
    if lamp.distant:
        towards = lamp.position / np.linalg.norm(lamp.position)
        return {"type": "directional", "direction": (-towards).tolist(), "irradiance": grey(lamp.intensity)}
    if lamp.radius_m:
        raise ValueError(f"a lamp of radius {lamp.radius_m:g} m, expected a point")
    strength = grey(lamp.intensity * REFERENCE_DISTANCE**2)
    return {"type": "point", "position": np.asarray(lamp.position, float).tolist(), "intensity": strength}


def perspective(sandbox_from_camera: Pose, lens: Lens) -> dict[str, Any]:
    """Return the sensor plugin of a camera with box-filtered pixels.

    Raises
    ------
    ValueError
        The lens distorts, or its pixels are not square.
    """
    import mitsuba as mi

    if any(lens.distortion) or abs(lens.fx / lens.fy - 1) > _SQUARE:
        raise ValueError("Mitsuba's camera has square pixels and no distortion")
    to_world = sandbox_from_camera.matrix @ np.diag([-1.0, -1.0, 1.0, 1.0])  # Mitsuba: x left, y up
    return {
        "type": "perspective",
        "fov": float(np.degrees(2 * np.arctan(lens.width / (2 * lens.fx)))),
        "fov_axis": "x",
        "principal_point_offset_x": 0.5 - lens.cx / lens.width,
        "principal_point_offset_y": 0.5 - lens.cy / lens.height,
        "near_clip": 0.01,
        "far_clip": 1000.0,
        "to_world": mi.ScalarTransform4f(to_world),
        "film": {
            "type": "hdrfilm",
            "width": lens.width,
            "height": lens.height,
            "pixel_format": "luminance",
            "component_format": "float32",
            "rfilter": {"type": "box"},
        },
        "sampler": {"type": "independent"},
    }


def mesh(name: str, surfaces: Surfaces, chosen: np.ndarray, material: dict[str, Any]) -> Any:
    """Return a smooth mesh object of the faces `chosen` (f,) bool."""
    import mitsuba as mi

    faces = surfaces.faces[chosen]
    used, numbers = np.unique(faces, return_inverse=True)
    properties = mi.Properties()
    properties["material"] = mi.load_dict(material)
    made = mi.Mesh(name, len(used), len(faces), properties, has_vertex_normals=True)
    filled = mi.traverse(made)
    filled["vertex_positions"] = np.ascontiguousarray(surfaces.vertices[used], np.float32).ravel()
    filled["vertex_normals"] = np.ascontiguousarray(surfaces.normals[used], np.float32).ravel()
    filled["faces"] = np.ascontiguousarray(numbers, np.uint32).ravel()
    filled.update()
    return made
