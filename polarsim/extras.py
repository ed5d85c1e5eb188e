"""Optional packages: the extra of pyproject.toml that installs each of them."""

from __future__ import annotations

from polarsim.errors import PolarsimError

EXTRA_OF = {  # extra of each importable package outside the core
    **dict.fromkeys(("numba", "llvmlite", "open3d", "pyarrow", "pycolmap", "snakemake"), "pipeline"),
    **dict.fromkeys(("torch", "torchvision", "ultralytics"), "detect"),
    "taichi": "taichi",
    **dict.fromkeys(("av", "gymnasium", "mujoco", "rasterio"), "rover"),
    **dict.fromkeys(("mcap", "mcap_ros2", "mlcroissant", "pxr", "rocrate", "rosbags"), "publish"),
}


class ExtraError(PolarsimError):
    """A package of an extra is not installed, or cannot be imported."""


def extra_error(error: ImportError) -> ExtraError | None:
    """Return the one-line error for a failed import; None if no extra installs the package."""
    package = (error.name or "").partition(".")[0]
    extra = EXTRA_OF.get(package)
    if extra is None:
        return None
    missing = isinstance(error, ModuleNotFoundError) and error.name == package
    reason = f"{package} is not installed" if missing else f"{package} cannot be imported ({error})"
    return ExtraError(f"{reason}: pip install 'polarsim[{extra}]'")
