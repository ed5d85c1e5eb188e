"""Names of the reflectance models. The module imports quickly, for the command line."""

from __future__ import annotations

from typing import Literal, get_args

Model = Literal["principled", "hapke", "lambert", "lunar_lambert", "hapke_chrono", "principled_chrono"]
MODELS: tuple[Model, ...] = get_args(Model)
CHRONO: tuple[Model, ...] = ("hapke_chrono", "principled_chrono")  # direct light only, as in the paper's images
FITTED: Literal["fitted"] = "fitted"  # domain of twins: principled, with light, lens and materials fitted to photos
Domain = Model | Literal["fitted"]  # of twins: a model with the parameters of the paper, or `FITTED`


def model_of(domain: Domain) -> Model:
    """Return the reflectance model of a domain of twins.

    The fitted domain uses the principled model: with fitted light it matches photos as well as Hapke's model, has two
    parameters instead of six, and its fit is stable.
    """
    return "principled" if domain == FITTED else domain
