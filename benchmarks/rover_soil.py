"""What the rover's soil costs a step, and how near it comes to its limit and to measured wheels.

`python -m benchmarks.rover_soil [--quick] [--fit] [--plots FOLDER]`

--fit fits the soils `trec-grc3`, `mgru3-tilt-bed` and `ex1-silica-5` anew; --plots draws a plot a check. CPU
seconds throughout, one thread.

Last figures (two shared cores, loaded; slips 0 to 0.8, both wheels, contact normal): 5 mm cells sinkage within 0.9 %,
torque 1.0 %, pull 2 % or 0.2 N; 2 cm cells 1.4 %, 1.7 %, 8 % or 1.0 N. Plates within 0.0001 %. Soils of their own: TREC
2.92 degrees RMS, tilt bed 1.31 (lunar 4.62, 4.87); EX1 slip 0.056, sinkage 0.93 mm (lunar 0.104, 1.44). Sinkage on Moon
and Earth 16.93 and 16.79 mm, with constants left alone 16.93 and 51.93. Locked on 15 degrees: -0.005 mm in 10 s. A step
of four wheels on 2 cm cells 103 us, 136 with bulldozing every 10 steps, 382 on 1 cm; busier 148, 195, 439.
"""

from __future__ import annotations

import argparse
import math
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
from scipy.optimize import least_squares

from polarsim.rover.soil import contact_numba, published
from polarsim.rover.soil.bulldozing import Bulldozing
from polarsim.rover.soil.check import SMOOTH_MGRU3, TILT_BED, TREC, Rig, SlopeCurve, drive, misses_deg
from polarsim.rover.soil.contact import Rule
from polarsim.rover.soil.law import ContactLaw, read_soils
from polarsim.rover.soil.limit import steady_wheel
from polarsim.rover.soil.nodes import make_ground
from polarsim.rover.soil.published import EX1_LOAD, EX1_WHEEL, SINKING_SLIPS, SLOPES_DEG
from polarsim.rover.soil.shapes import Bodies, Plate, Wheel
from tests.support.rover_rigs import SoilBin, park, patch_inverse_width, rest_plate

SOILS = read_soils(Path(__file__).parents[1] / "config" / "soils.csv")
WHEELS = {"A": (Wheel(0.25, 0.20), "lunar", 174.15), "B": (Wheel(0.15735, 0.165), "hit-simulant", 80.0)}
SLIPS = (0, 0.05, 0.1, 0.2, 0.4, 0.6, 0.8)


def step_costs(seconds: float) -> None:
    """Four wheels of a rover on 12 x 4 m of level ground at 0.2 m/s, 1 ms; microseconds a step."""
    wheel, soil = WHEELS["A"][0], SOILS["lunar"]
    corners = np.array([(0.642, 0.61), (0.642, -0.61), (-0.642, 0.61), (-0.642, -0.61)])
    for label, cell, rule in (
        ("2 cm", 0.02, None),
        ("2 cm, bulldozing every 10 steps", 0.02, Bulldozing()),
        ("2 cm, bulldozing every step", 0.02, Bulldozing(every=1)),
        ("1 cm, bulldozing every 10 steps", 0.01, Bulldozing()),
    ):
        ground = make_ground(np.zeros((round(4 / cell), round(12 / cell))), cell, -2.0, -2.0)
        bed = SoilBin(ground, soil.law(), bulldozing_rule=rule)
        numbers, rotations = np.repeat(wheel.numbers(cell)[None], 4, 0), np.repeat(np.eye(3)[None], 4, 0)
        spins, speed = np.tile([0.0, 0.2 / wheel.radius, 0.0], (4, 1)), 0.195
        centres = np.column_stack([corners, np.full(4, wheel.radius)])
        sinking, spent, steps = np.zeros(4), 0.0, round(seconds / 1e-3)
        for step in range(-200, steps):  # the first 200 settle and compile
            velocities = np.column_stack([np.full(4, speed), np.zeros(4), sinking])
            bodies = Bodies(numbers, centres, rotations, velocities, spins)
            began = time.process_time()
            forces = bed.step(bodies, 1e-3).forces[:, 2]
            spent += (time.process_time() - began) * (step >= 0)
            sinking = (sinking + 1e-3 * (forces - 174.15) / 20) / (1 + 1e-3 * 1500 / 20)
            centres = centres + 1e-3 * velocities
        print(f"{label}: {1e6 * spent / steps:.0f} us a step of 4 wheels")


def plates() -> None:
    for load, plate in ((174.15, Plate(0.2, 0.2)), (174.15, Plate(0.3, 0.1)), (1054.6, Plate(0.2, 0.2))):
        for inverse in (1 / plate.width, patch_inverse_width(plate.length, plate.width)):
            soil = SOILS["lunar"]
            depth = rest_plate(replace(plate, inverse_width=inverse), soil.law(), load, 0.02, contact_numba.press)
            wanted = load / (plate.length * plate.width) / (soil.K_c * inverse + soil.K_phi)
            print(f"plate {plate.length} x {plate.width} m: {1000 * depth:.4f} mm, {100 * (depth / wanted - 1):+.4f} %")


def against_limit(slips: tuple[float, ...]) -> list[dict[str, float | str | bool]]:
    """Wheels A and B on both grids and under both normals, beside the integrals."""
    rows = []
    for cell, K_e in ((0.005, 4e9), (0.02, 2e8)):
        for terrain in (False, True):
            for name, (wheel, soil, load) in WHEELS.items():
                law = replace(SOILS[soil], K_e=K_e, R=0.0).law(slip_sinkage=False)
                for slip in slips:
                    limit = steady_wheel(wheel, law, load, slip, terrain)
                    found = drive(wheel, law, load, slip, cell, Rig(), Rule(terrain), contact_numba.press)
                    row = {"cell": cell, "terrain": terrain, "wheel": name, "slip": slip}
                    for what in ("sinkage", "pull", "torque"):
                        row[what], row[f"{what}_limit"] = getattr(found, what), getattr(limit, what)
                    rows.append(row)
                    print(
                        f"{1000 * cell:g} mm, {'terrain' if terrain else 'contact'}, wheel {name}, slip {slip:g}: "
                        f"sinkage {1000 * found.sinkage:.2f} mm {100 * (found.sinkage / limit.sinkage - 1):+.2f} %, "
                        f"pull {found.pull:.1f} N {found.pull - limit.pull:+.2f} N, "
                        f"torque {found.torque:.2f} N m {100 * (found.torque / limit.torque - 1):+.2f} %"
                    )
    return rows


def rms_deg(curve: SlopeCurve, law: ContactLaw) -> float:
    return float(np.sqrt((misses_deg(curve, law) ** 2).mean()))


def fit_law(curve: SlopeCurve) -> ContactLaw:
    """The soil without cohesion, n = 1, that comes nearest: K_phi, friction angle and K by least squares."""

    def law(numbers: np.ndarray) -> ContactLaw:
        K_mm, phi_deg, K_phi_mega = numbers
        return ContactLaw(K_phi_mega * 1e6, 0.0, 1.0, 0.0, 0.0, math.tan(math.radians(phi_deg)), K_mm * 1e-3, 4e9, 0.0)

    def misses(numbers: np.ndarray) -> np.ndarray:
        return misses_deg(curve, law(numbers))

    bounds = ([1.0, 10.0, 0.05], [60.0, 50.0, 10.0])
    return law(least_squares(misses, [10.0, 30.0, 1.0], bounds=bounds, x_scale=[5, 10, 1], diff_step=[1e-3] * 3).x)


def fit_ex1() -> ContactLaw:
    """The soil without cohesion, n = 1, that comes nearest to EX1's slip and sinkage: K_phi, friction, K, n_slip."""

    def law(numbers: np.ndarray) -> ContactLaw:
        K_mm, phi_deg, K_phi_mega, n_slip = numbers
        tan_phi = math.tan(math.radians(phi_deg))
        return ContactLaw(K_phi_mega * 1e6, 0.0, 1.0, n_slip, 0.0, tan_phi, K_mm * 1e-3, 4e9, 0.0)

    def misses(numbers: np.ndarray) -> np.ndarray:
        return np.concatenate(ex1_misses(law(numbers))) / np.repeat([0.05, 2.0], 5)  # of slip, and mm

    # From a start too weak the wheel climbs no slope, and nothing there tells which way is better.
    start, bounds = [10.0, 40.0, 5.0, 1.0], ([0.5, 10.0, 0.05, 0.0], [60.0, 50.0, 20.0, 3.0])
    return law(least_squares(misses, start, bounds=bounds, x_scale=[5, 10, 1, 0.5], diff_step=[1e-3] * 4).x)


def ex1_misses(law: ContactLaw) -> tuple[np.ndarray, np.ndarray]:
    """(5,) slips, of 1 where it does not climb, and (5,) sinkages, mm, above those of Kern et al."""
    slips = [published.slip_on_slope(EX1_WHEEL, law, EX1_LOAD, slope) for slope in SLOPES_DEG]
    sinkages = [1000 * steady_wheel(EX1_WHEEL, law, EX1_LOAD, slip).sinkage for slip in SINKING_SLIPS]
    wanted = [published.slip_of_slope(slope) for slope in SLOPES_DEG]
    deep = [published.sinkage_of_slip_mm(slip) for slip in SINKING_SLIPS]
    return np.nan_to_num(slips, nan=1.0) - wanted, np.subtract(sinkages, deep)


def against_ex1(fit: bool) -> None:
    for name in (published.EX1_SOIL, "lunar"):
        slips, sinkages = ex1_misses(SOILS[name].at_gravity(published.EARTH).law())
        rms = [float(np.sqrt((part**2).mean())) for part in (slips, sinkages)]
        print(f"EX1: {name} slip {rms[0]:.3f} RMS, sinkage {rms[1]:.2f} mm RMS")
    if fit:
        law = fit_ex1()
        slips, sinkages = ex1_misses(law)
        phi_deg = math.degrees(math.atan(law.tan_phi))
        print(
            f"  fitted: K_phi {law.K_phi:.4g}, phi {phi_deg:.2f} degrees, K {1000 * law.K:.2f} mm, "
            f"n_slip {law.n_slip:.3f}: slips {slips.round(3)}, sinkages {sinkages.round(2)} mm"
        )


def against_measured(fit: bool) -> None:
    for curve, name in ((TREC, "trec-grc3"), (TILT_BED, "mgru3-tilt-bed")):
        print(f"{curve.name}: {name} {rms_deg(curve, SOILS[name].law()):.2f} degrees RMS", end="")
        print(f", lunar {rms_deg(curve, SOILS['lunar'].law(slip_sinkage=False)):.2f}")
        if fit:
            law = fit_law(curve)
            phi_deg, rms = math.degrees(math.atan(law.tan_phi)), rms_deg(curve, law)
            print(f"  fitted: K_phi {law.K_phi:.4g}, phi {phi_deg:.2f} degrees, K {1000 * law.K:.2f} mm: {rms:.2f} RMS")


def gravity_and_slope() -> None:
    soil, wheel = SOILS["lunar"], WHEELS["A"][0]
    for scaled in (True, False):
        depths = []
        for g in (1.62, 9.81):
            law = (soil.at_gravity(g) if scaled else soil).law(slip_sinkage=False)
            rig = Rig(damper=1500 * g / 1.62)
            depths.append(drive(wheel, law, 107.5 * g, 0.05, 0.02, rig, Rule(), contact_numba.press).sinkage)
        how = "scaled" if scaled else "constants alone"
        print(f"Moon {1000 * depths[0]:.2f} mm, Earth {1000 * depths[1]:.2f} mm, {how}")
    for slope in (10, 15):
        parked = park(wheel, soil.law(), 107.5, 1.62, slope, 0.02, 12.0, contact_numba.press)
        creep, held = 1000 * parked.creep(2, 12), 1000 * parked.slid[-1]
        print(f"locked on {slope} degrees: {creep:+.4f} mm in 10 s, held after {held:.1f} mm")


def plot(rows: list[dict], folder: Path) -> None:
    """One picture a check: wheels against their limit, fitted soils against NASA's points, the rut and its berms."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot

    folder.mkdir(parents=True, exist_ok=True)
    labels = {"sinkage": ("sinkage, mm", 1000), "pull": ("drawbar pull, N", 1), "torque": ("torque, N m", 1)}
    for name, (wheel, soil, load) in WHEELS.items():
        figure, axes = pyplot.subplots(1, 3, figsize=(11, 3.2), layout="constrained")
        fine = np.linspace(0, 0.8, 60)
        for axis, (what, (text, scale)) in zip(axes, labels.items(), strict=True):
            for terrain, colour in ((False, "C0"), (True, "C1")):
                law = replace(SOILS[soil], K_e=4e9, R=0.0).law(slip_sinkage=False)
                curve = [scale * getattr(steady_wheel(wheel, law, load, slip, terrain), what) for slip in fine]
                axis.plot(fine, curve, colour, label=f"limit, {'terrain' if terrain else 'contact'} normal")
                for cell, mark in ((0.005, "o"), (0.02, "x")):
                    kept = [r for r in rows if (r["wheel"], r["terrain"], r["cell"]) == (name, terrain, cell)]
                    axis.plot(
                        [r["slip"] for r in kept], [scale * r[what] for r in kept], mark, color=colour, mfc="none"
                    )
            axis.set(xlabel="slip", ylabel=text)
        axes[1].legend(fontsize=7, title="o 5 mm cells, x 2 cm", title_fontsize=7)
        figure.savefig(folder / f"limit_{name}.png", dpi=90)
    figure, axes = pyplot.subplots(1, 2, figsize=(8, 3.2), layout="constrained")
    for axis, curve, name in zip(axes, (TREC, TILT_BED), ("trec-grc3", "mgru3-tilt-bed"), strict=True):
        slip, slope = np.array(curve.points).T
        order = np.argsort(slip)
        axis.plot(slip, slope, "ko", mfc="none", label="NASA")
        for soil in (name, "lunar"):
            law = SOILS[soil].law(slip_sinkage=False)
            axis.plot(slip[order], (slope + misses_deg(curve, law, SMOOTH_MGRU3))[order], label=soil)
        axis.set(xlabel="slip, %", ylabel="slope, degrees", title=curve.name)
        axis.legend(fontsize=7)
    figure.savefig(folder / "measured.png", dpi=90)
    figure, axis = pyplot.subplots(figsize=(5, 3.2), layout="constrained")
    for slope in (10, 15):
        parked = park(WHEELS["A"][0], SOILS["lunar"].law(), 107.5, 1.62, slope, 0.02, 12.0, contact_numba.press)
        axis.plot(parked.time, 1000 * parked.slid, label=f"{slope} degrees")
    axis.set(xlabel="time, s", ylabel="slid downhill, mm", title="wheel locked on a slope")
    axis.legend()
    figure.savefig(folder / "locked.png", dpi=90)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true", help="costs and three slips only")
    parser.add_argument("--fit", action="store_true")
    parser.add_argument("--plots", type=Path)
    asked = parser.parse_args()
    step_costs(2.0 if asked.quick else 10.0)
    plates()
    against_measured(asked.fit)
    against_ex1(asked.fit)
    gravity_and_slope()
    rows = against_limit(SLIPS[::3] if asked.quick else SLIPS)
    if asked.plots:
        plot(rows, asked.plots)


if __name__ == "__main__":
    main()
