"""Optional packages: the extra of pyproject.toml that installs each of them."""

from __future__ import annotations

from importlib.util import find_spec

from polarsim.errors import PolarsimError

EXTRA_OF = {  # extra of each importable package outside the core
    **dict.fromkeys(("numba", "llvmlite", "open3d", "pyarrow", "pycolmap", "snakemake"), "pipeline"),
    **dict.fromkeys(("torch", "torchvision", "ultralytics"), "detect"),
    "laspy": "las",
    "taichi": "taichi",
    **dict.fromkeys(("av", "gymnasium", "mujoco", "rasterio"), "rover"),
    **dict.fromkeys(("mcap", "mcap_ros2", "mlcroissant", "pxr", "rocrate", "rosbags"), "publish"),
}


class ExtraError(PolarsimError):
    """A package of an extra is not installed, or cannot be imported."""

    def __str__(self) -> str:
        return self.reason  # without the file that was being read


def require(*packages: str) -> None:
    """Raise an `ExtraError` for the first package that is not installed, before work that would be lost."""
    for package in packages:
        if find_spec(package) is None:
            raise ExtraError(_advice(package, "is not installed"))


def extra_error(error: ImportError) -> ExtraError | None:
    """Return the one-line error for a failed import; None if no extra installs the package."""
    package = (error.name or "").partition(".")[0]
    if package not in EXTRA_OF:
        return None
    missing = isinstance(error, ModuleNotFoundError) and error.name == package
    return ExtraError(_advice(package, "is not installed" if missing else f"cannot be imported ({error})"))


def _advice(package: str, problem: str) -> str:
    return f"{package} {problem}: pip install 'polarsim[{EXTRA_OF[package]}]'"
