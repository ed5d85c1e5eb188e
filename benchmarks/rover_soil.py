"""Cost of a step of the rover's soil, and accuracy against its limit and against measured wheels.

`python -m benchmarks.rover_soil [--quick] [--fit] [--wheels FOLDER]`

--fit fits the soils `trec-grc3`, `mgru3-tilt-bed` and `ex1-silica-5` again. --wheels compares with the 27 single-wheel
measurements of RoverDevKit (`single_wheel_experiments.csv`, `soil_simulants.csv`) and fits nothing; with --fit, it also
shows the smallest errors with fitted constants of the contact model (a minute). CPU seconds on one thread.

Last metrics (two shared cores, loaded; slips 0 to 0.8, both wheels): 5 mm cells sinkage within 0.9 %, torque 0.8 %,
pull 0.2 N; 2 cm cells 1.7 %, 1.5 %, 1.2 N. Fitted soils: TREC 2.69 degrees RMS, tilt bed 1.13 (lunar 5.40, 3.36); EX1
slip 0.041, sinkage 0.91 mm (lunar 0.089, 1.33). Median errors of pull, sinkage, torque of the measured wheels, %:
ding2011 25, 44, 26; wang_han_2016_kls1 57, 274, 26; hurrell2025_rashid1 16, 35. A step of four wheels on 2 cm cells
33 us, 45 with bulldozing every 10 steps, 145 on 1 cm.
"""

from __future__ import annotations

import argparse
import math
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from itertools import combinations, product
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pandas as pd
from scipy.optimize import differential_evolution, least_squares

from polarsim.errors import RoverError
from polarsim.formats import tables
from polarsim.rover.soil.bulldozing import Bulldozing
from polarsim.rover.soil.law import SMOOTH_FRICTION, ContactLaw, Soil, read_soils
from polarsim.rover.soil.nodes import make_soil_ground
from polarsim.rover.soil.shapes import Bodies, Wheel
from tests.reference.soil_limit import steady_wheel
from tests.reference.soil_published import EARTH, TILT_BED, TREC, ex1_misses, misses_deg
from tests.reference.soil_rig import LOAD_A, LOAD_B, WHEEL_A, WHEEL_B, Rig, SoilBin, drive

SOILS = read_soils(Path(__file__).parents[1] / "config" / "soils.csv")
SLIPS = (0, 0.05, 0.1, 0.2, 0.4, 0.6, 0.8)


def step_costs(seconds: float) -> None:
    """Print microseconds per step of four wheels on 12 x 4 m of level ground at 0.2 m/s, 1 ms."""
    corners = np.array([(0.642, 0.61), (0.642, -0.61), (-0.642, 0.61), (-0.642, -0.61)])
    for label, cell, rule in (
        ("2 cm", 0.02, None),
        ("2 cm, bulldozing every 10 steps", 0.02, Bulldozing.on(0.02)),
        ("1 cm, bulldozing every 10 steps", 0.01, Bulldozing.on(0.01)),
    ):
        ground = make_soil_ground(np.zeros((round(4 / cell), round(12 / cell))), cell, -2.0, -2.0)
        bed = SoilBin(ground, SOILS["lunar"].law(), rule)
        shapes, rotations = np.repeat(WHEEL_A.numbers()[None], 4, 0), np.repeat(np.eye(3)[None], 4, 0)
        spins, speed = np.tile([0.0, 0.2 / WHEEL_A.radius, 0.0], (4, 1)), 0.195
        centres = np.column_stack([corners, np.full(4, WHEEL_A.radius)])
        sinking, spent, steps = np.zeros(4), 0.0, round(seconds / 1e-3)
        for step in range(-200, steps):  # the first 200 settle and compile
            velocities = np.column_stack([np.full(4, speed), np.zeros(4), sinking])
            began = time.process_time()
            forces = bed.step(Bodies(shapes, centres, rotations, velocities, spins), 1e-3).forces[:, 2]
            spent += (time.process_time() - began) * (step >= 0)
            sinking = (sinking + 1e-3 * (forces - LOAD_A) / 20) / (1 + 1e-3 * 1500 / 20)
            centres = centres + 1e-3 * velocities
        print(f"{label}: {1e6 * spent / steps:.0f} us a step of 4 wheels")


def against_limit(slips: tuple[float, ...]) -> None:
    """Compare wheels on both grids with the integrals of an infinitely fine grid."""
    for cell, K_e in ((0.005, 4e9), (0.02, 2e8)):
        for wheel, soil, load in ((WHEEL_A, "lunar", LOAD_A), (WHEEL_B, "hit-simulant", LOAD_B)):
            law = replace(SOILS[soil], K_e=K_e, R=0.0).law(slip_sinkage=False)
            for slip in slips:
                limit, found = steady_wheel(wheel, law, load, slip), drive(wheel, law, load, slip, cell, Rig())
                print(
                    f"{1000 * cell:g} mm, {soil}, slip {slip:g}: "
                    f"sinkage {1000 * found.sinkage:.2f} mm {100 * (found.sinkage / limit.sinkage - 1):+.2f} %, "
                    f"pull {found.pull:.1f} N {found.pull - limit.pull:+.2f} N, "
                    f"torque {found.torque:.2f} N m {100 * (found.torque / limit.torque - 1):+.2f} %"
                )


def rms(misses: np.ndarray) -> float:
    return float(np.sqrt((misses**2).mean()))


def fitted(misses: Callable[[ContactLaw], np.ndarray], start: list[float]) -> str:
    """Fit a soil without cohesion, n = 1: K, friction angle, K_phi, and n_slip if `start` has four numbers."""
    names, size = ("K mm", "phi degrees", "K_phi MPa/m", "n_slip"), len(start)

    def law(numbers: np.ndarray) -> ContactLaw:
        K_mm, phi_deg, K_phi_mega, n_slip = (*numbers, 0.0)[:4]
        tan_phi = math.tan(math.radians(phi_deg))
        return ContactLaw(K_phi_mega * 1e6, 0.0, 1.0, n_slip, 0.0, tan_phi, K_mm * 1e-3, 4e9, 0.0)

    bounds = [0.5, 10.0, 0.05, 0.0][:size], [60.0, 50.0, 20.0, 3.0][:size]
    found = least_squares(
        lambda numbers: misses(law(numbers)), start, bounds=bounds, x_scale=[5, 10, 1, 0.5][:size],
        diff_step=[1e-3] * size,
    ).x  # fmt: skip
    return ", ".join(f"{name} {value:.4g}" for name, value in zip(names, found, strict=False))


def against_measured(fit: bool) -> None:
    for curve, name in ((TREC, "trec-grc3"), (TILT_BED, "mgru3-tilt-bed")):
        for soil in (name, "lunar"):
            misses = misses_deg(curve, SOILS[soil].law(slip_sinkage=False))
            print(f"{curve.name}: {soil} {rms(misses):.2f} degrees RMS")
        if fit:
            print("  fitted:", fitted(lambda law, curve=curve: misses_deg(curve, law), [10.0, 30.0, 1.0]))
    for soil in ("ex1-silica-5", "lunar"):
        slips, sinkages = ex1_misses(SOILS[soil].at_gravity(EARTH).law())
        print(f"EX1: {soil} slip {rms(slips):.3f} RMS, sinkage {rms(sinkages):.2f} mm RMS")
    if fit:  # with a weaker start, the wheel climbs no slope and the gradient is zero
        scale = np.repeat([0.05, 2.0], 5)  # of slip, and mm
        print("  fitted:", fitted(lambda law: np.concatenate(ex1_misses(law)) / scale, [10.0, 40.0, 5.0, 1.0]))


class WheelModel(NamedTuple):
    """Constants of the contact model that are not constants of a soil."""

    n_slip: float = 0.0  # no simulant has a published value
    smooth_friction: float = SMOOTH_FRICTION  # of smooth rims, share of the soil's friction angle
    peak: float = 0.0  # angle of the maximum pressure at slip 0, share of the entry angle
    peak_per_slip: float = 0.0
    tips: bool = True  # radius at the tips of grousers, not of the rim


PEAKS = {
    "none": (0.0, 0.0),
    "loose sand (Wong and Reece 1967)": (0.18, 0.32),
    "dense sand (Wong and Reece 1967)": (0.43, 0.32),
    "lunar simulant (Ishigami et al. 2007)": (0.4, 0.15),
}


@dataclass(frozen=True)
class MeasuredWheels:
    """Single-wheel measurements of RoverDevKit with the published parameters of their soils."""

    rows: pd.DataFrame
    simulants: pd.DataFrame  # by name

    def states(self, model: WheelModel) -> np.ndarray:
        """Return predicted pull, sinkage and torque (n, 3); NaN for wheels that sink to the axle."""
        found = []
        for row in self.rows.to_dict("records"):
            simulant, height = self.simulants.loc[row["soil_simulant"]], row["grouser_height_m"]
            # For this width: KLS-1 has a negative K_c, which a table of soils refuses.
            stiffness = simulant["k_phi_kN_per_m_n_plus_2"] + simulant["k_c_kN_per_m_n_plus_1"] / row["wheel_width_m"]
            soil = Soil(
                row["soil_simulant"], 1e3 * stiffness, 0.0, simulant["n"], model.n_slip, 1e3 * simulant["cohesion_kPa"],
                simulant["friction_angle_deg"], row["soil_shear_modulus_k_m"], 4e9, 0.0, EARTH, simulant["citation"],
            )  # fmt: skip
            law = soil.law()
            if height == 0:
                law = law._replace(c=0.0, tan_phi=math.tan(math.radians(model.smooth_friction * soil.phi_deg)))
            wheel = Wheel(row["wheel_radius_m"] + model.tips * height, row["wheel_width_m"])
            peak = model.peak + model.peak_per_slip * row["slip"]
            try:
                state = steady_wheel(wheel, law, row["vertical_load_n"], row["slip"], peak)
                found.append((state.pull, state.sinkage, state.torque))
            except RoverError:
                found.append((math.nan,) * 3)
        return np.array(found)

    def median_errors(self, model: WheelModel) -> dict[str, np.ndarray]:
        """Return by testbed the median relative errors (3,) of pull, sinkage and torque; NaN without measurements."""
        measured = self.rows[["meas_drawbar_pull_n", "meas_sinkage_m", "meas_torque_nm"]].to_numpy(float)
        measured[measured == 0] = np.nan  # torque at slip 0
        errors = pd.DataFrame(np.abs(self.states(model) / measured - 1).tolist())
        errors[0] = errors[0].fillna(math.inf)  # all pulls are measured
        return {str(source): own.to_numpy() for source, own in errors.groupby(self.rows["source"]).median().iterrows()}

    def fitted(self) -> WheelModel:
        """Return the constants with the smallest maximum of the testbeds' median errors of pull.

        The function has many minima; the search starts from the best of five longer searches.
        """

        def worst(numbers: np.ndarray) -> float:
            return float(max(errors[0] for errors in self.median_errors(WheelModel(*numbers)).values()))

        bounds, start = [(0, 1.5), (0.4, 1), (0, 0.5), (0, 0.5)], [0.7, 0.92, 0.18, 0.5]
        found = differential_evolution(worst, bounds, x0=start, maxiter=30, popsize=10, polish=False, seed=0)
        return WheelModel(*found.x)


def against_wheels(folder: Path, fit: bool) -> None:
    """Print median errors of pull, sinkage and torque by testbed, with the published soil parameters.

    With the model of drives, single changes, all combinations of constants from literature, and constants fitted to
    all rows. Finally, the smallest median error of pull of any model that does not distinguish wheels by grousers.
    """
    rows = tables.read_csv(folder / "single_wheel_experiments.csv")
    wheels = MeasuredWheels(rows, tables.read_csv(folder / "soil_simulants.csv").set_index("simulant"))
    sources = list(dict.fromkeys(rows["source"]))
    models = {
        "drives": WheelModel(),
        "slip sinkage": WheelModel(n_slip=1.0),
        "radius of the rim": WheelModel(tips=False),
        "soil friction on smooth rims": WheelModel(smooth_friction=1.0),
        "friction of smooth steel (Potyondy 1961)": WheelModel(smooth_friction=0.54),
        "friction of rough steel (Potyondy 1961)": WheelModel(smooth_friction=0.76),
        **{
            f"maximum in front, {name}": WheelModel(0, SMOOTH_FRICTION, *peak)
            for name, peak in PEAKS.items()
            if any(peak)
        },
    }
    if fit:
        models["fitted to all testbeds"] = wheels.fitted()
    for name, model in models.items():
        print(
            f"{name} ({', '.join(f'{number:.2f}' for number in model[:4])}): median error of pull, sinkage, torque, %"
        )
        for source, errors in wheels.median_errors(model).items():
            print(f"  {source} " + ", ".join(f"{100 * error:.1f}" for error in errors))
    variants = [
        WheelModel(n_slip, friction, *peak, tips)
        for n_slip, friction, peak, tips in product((0, 0.5, 1), (SMOOTH_FRICTION, 1), PEAKS.values(), (True, False))
    ]
    pulls = pd.DataFrame(
        [{source: errors[0] for source, errors in wheels.median_errors(model).items()} for model in variants]
    )
    for source in sources:
        low, high = 100 * pulls[source].min(), 100 * pulls[source].max()
        print(f"{source}: median error of pull {low:.0f} to {high:.0f} % with {len(pulls)} combinations of constants")
    print(f"largest of the testbeds at least {100 * pulls.max(axis=1).min():.0f} %")
    for source, own in rows.groupby("source", sort=False):
        print(f"{source}: median error of pull at least {100 * least_error(own):.0f} % for any model without grousers")


def least_error(rows: pd.DataFrame) -> float:
    """Return the smallest median relative error of pull of a model that does not distinguish wheels by grousers.

    Such a model has one prediction for all rows with the same wheel, soil, load and slip. One of their measured pulls
    is a best prediction, or that with the same error for two of them.
    """
    inputs = ["wheel_radius_m", "wheel_width_m", "soil_simulant", "vertical_load_n", "slip"]
    choices = []
    for _, same in rows.groupby(inputs):
        pulls = same["meas_drawbar_pull_n"].to_numpy(float)
        between = [2 * a * b / (a + b) for a, b in combinations(pulls, 2) if a * b > 0]
        choices.append([np.abs(pull / pulls - 1) for pull in (*pulls, *between)])
    return float(min(np.median(np.concatenate(chosen)) for chosen in product(*choices)))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="costs and three slips only")
    parser.add_argument("--fit", action="store_true")
    parser.add_argument("--wheels", type=Path, help="folder of RoverDevKit's single-wheel measurements, alone")
    asked = parser.parse_args()
    if asked.wheels:
        against_wheels(asked.wheels, asked.fit)
        return
    step_costs(2.0 if asked.quick else 10.0)
    against_measured(asked.fit)
    against_limit(SLIPS[::3] if asked.quick else SLIPS)


if __name__ == "__main__":
    main()
