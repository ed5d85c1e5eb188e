"""Names of the reflectance models. The module imports quickly, for the command line."""

from __future__ import annotations

from typing import Literal, get_args

Model = Literal["principled", "hapke", "lambert", "lunar_lambert", "hapke_chrono", "principled_chrono"]
MODELS: tuple[Model, ...] = get_args(Model)
CHRONO: tuple[Model, ...] = ("hapke_chrono", "principled_chrono")  # direct light only, as in the paper's images
