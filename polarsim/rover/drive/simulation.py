"""Time stepping of a rover on soft ground: rigid bodies and rocks by MuJoCo, soil by polarsim's contact model."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import pandas as pd
from scipy.spatial.transform import Rotation

from polarsim.rover.drive import energy
from polarsim.rover.drive.control import Command, steer
from polarsim.rover.drive.mjcf import LINKS, compile_model
from polarsim.rover.drive.near_rocks import NearRocks
from polarsim.rover.drive.state import EDGE_MARGIN_M, OffGridError, RoverState, Start, heading_of
from polarsim.rover.drive.trace import CONTACT_COLUMNS, CONTACTS, GROUND, WHEEL_COLUMNS
from polarsim.rover.soil.bulldozing import EVERY_S, Bulldozing
from polarsim.rover.soil.contact import Loads
from polarsim.rover.soil.law import Soil
from polarsim.rover.soil.nodes import make_soil_ground
from polarsim.rover.soil.options import SoilOptions
from polarsim.rover.soil.shapes import Bodies, Wheel
from polarsim.rover.vehicle.table import WHEELS, Vehicle
from polarsim.rover.world.mesh_heights import under_rocks
from polarsim.rover.world.rock_parts import RockPart, rock_parts, shape_table
from polarsim.rover.world.surface import World

SPIN = 2  # index among a wheel's joints: lift, steer, spin
NO_WHEEL = -1
NO_CONTACT = -1
# Kind and link of each part of the rover, in the order of the kernels.
PARTS = tuple(
    (part, link)
    for part, links in (("tread", LINKS[:4]), ("flank", LINKS[:4]), ("leg", LINKS[4:8]), ("body", LINKS[8:]))
    for link in links
)


class Simulation:
    """A rover in a world; equal arguments and commands give equal bytes.

    `soil` is the soil as measured; the simulation scales it to the gravity of the options. `parts` are the convex parts
    of the world's rocks, computed if missing. The rover starts at rest and must settle before it drives. A start off
    the grid, a rock without volume and a time step that is too large for the soil are errors.
    """

    def __init__(
        self,
        world: World,
        vehicle: Vehicle,
        soil: Soil,
        options: SoilOptions | None = None,
        start: Start | None = None,
        parts: Sequence[RockPart] | None = None,
    ) -> None:
        import mujoco  # an optional dependency

        from polarsim.rover.drive import mujoco_kernels

        self._mujoco, self._kernels = mujoco, mujoco_kernels
        options = options or SoilOptions()
        self.world, self.vehicle, self.dt = world, vehicle, options.step_s
        self.soil = soil.at_gravity(options.gravity_m_s2)
        self._law = self.soil.law(options.slip_sinkage, not any(wheel.grousers for wheel in vehicle.wheels))
        energy.require_small_step(vehicle, self._law, options)
        parts = rock_parts(world) if parts is None else parts
        self.rock_shapes = shape_table(parts)
        self.rocks = np.array([shape["rock"] for shape in self.rock_shapes], int)
        self.ground = make_soil_ground(world.level, world.cell, world.x0, world.y0, under_rocks(world))
        self.model = compile_model(vehicle, world, parts, options.gravity_m_s2, self.dt)
        self.data = self._mujoco.MjData(self.model)
        self._wire()
        self.steps, self.guarded = 0, False
        self.time_zero = 0  # steps at time 0
        self.command = Command()
        self._put_down(start or Start())
        bodies = [self.model.body(f"rock{rock}").id for rock in self.rocks]
        self._near_rocks = NearRocks(self.model, self.data, bodies)

    @property
    def time(self) -> float:
        """Seconds since `zero`."""
        return (self.steps - self.time_zero) * self.dt

    @property
    def heading(self) -> float:
        """Heading of base_link, from x towards y."""
        return heading_of(self.data.qpos[3:7])

    @property
    def account(self) -> energy.Account:
        """Energy account since `zero`."""
        motor, soil, damper, rock, driving, *by_wheel = self._records.account.tolist()
        change = self._mechanical() - self._energy_zero
        return energy.Account(motor, soil, damper, rock, driving, tuple(by_wheel[:4]), tuple(by_wheel[4:]), change)

    def zero(self) -> None:
        """Set time and energy to zero, once the rover has settled; from now on the energy balance is checked."""
        self.guarded = True
        self.time_zero = self.steps
        self._records.account[:] = 0.0
        self._energy_zero = self._mechanical()
        self._records.first[:], self._records.last[:] = NO_CONTACT, NO_CONTACT
        self._records.touching[:], self._records.impulse[:] = 0, 0.0

    def contacts(self) -> pd.DataFrame:
        """Return a row per part of the rover and rock (`GROUND`: -1) that touched since `zero`, by first contact.

        `part` is `tread`, `flank`, `leg` or `body`; `time_s` the first contact, `duration_s` the time in contact,
        `impulse_n_s` the absolute force over time, `force_n` the maximum force. These are MuJoCo's contacts at each
        step. Wheels carry the rover by the soil; only body and legs touch the ground.
        """
        records = self._records
        rows, parts = np.nonzero(records.first >= 0)
        columns = (
            np.append(self.rocks, GROUND)[rows],
            [PARTS[part][0] for part in parts],
            [PARTS[part][1] for part in parts],
            (records.first[rows, parts] - self.time_zero) * self.dt,
            records.touching[rows, parts] * self.dt,
            records.impulse[rows, parts],
        )
        found = pd.DataFrame(dict(zip(CONTACT_COLUMNS, columns, strict=True)))
        return found.sort_values(["time_s", "rock", "part", "link"], ignore_index=True)

    def rocks_touched_since(self, steps: int) -> frozenset[int]:
        """Return the numbers of the rocks that a part of the rover touched at or after a step (see `steps`)."""
        return frozenset(self.rocks[(self._records.last[:-1] >= steps).any(axis=1)].tolist())

    def apply(self, command: Command) -> None:
        """Set the command of all wheels; the vehicle's steering rate is limited."""
        self.command = command

    def advance(self, seconds: float) -> None:
        """Advance by one or more steps. Set points of servos change once per call, so use short calls while steering.

        `OffGridError`: a wheel leaves the grid. `EnergyError`: the state is not finite or the energy balance is open.
        """
        steps = max(round(seconds / self.dt), 1)
        self._require_inside(self.data.xpos[self._physics.wheels])
        self._steer(steps * self.dt)
        self._near_rocks.update(self.data.qpos[:2], steps * self.dt)
        self._run(steps)
        if not (np.isfinite(self.data.qpos).all() and np.isfinite(self.data.qvel).all()):
            raise energy.EnergyError(f"at {self.time:.2f} s the rover's state is not finite: use a smaller step_s")
        if self.guarded:
            energy.require_closed(self.account, self.time)

    def state(self) -> RoverState:
        data, position = self.data, self.data.qpos
        return RoverState(
            time=self.time,
            position=position[:3].copy(),
            rotation=position[3:7].copy(),
            velocity=data.qvel[:3].copy(),
            spin=data.qvel[3:6].copy(),
            acceleration=data.sensordata[:3].copy(),
            command=self.command,
            energy_open=self.account.open,
            wheels=self._wheel_table(),
        )

    def _require_inside(self, centres: np.ndarray) -> None:
        """Check that no wheel is outside the grid, where no soil supports it."""
        low_x, low_y, high_x, high_y = self._inside
        for x, y in centres[:, :2].tolist():
            if not (low_x <= x <= high_x and low_y <= y <= high_y):
                raise OffGridError(
                    f"a wheel at ({x:.2f}, {y:.2f}) m leaves the ground; centres of wheels must have x {low_x:.2f} to "
                    f"{high_x:.2f} m and y {low_y:.2f} to {high_y:.2f} m"
                )

    def _wire(self) -> None:
        """Create views of MuJoCo's memory and arrays for the results of the kernels."""
        data, vehicle, kernels, count = self.data, self.vehicle, self._kernels, len(WHEELS)
        rims = {self.model.geom(f"{code}_rim").id: number for number, code in enumerate(WHEELS)}
        self._wheel_of_geom = [rims.get(geom, NO_WHEEL) for geom in range(self.model.ngeom)]
        self._physics = kernels.Physics(
            *kernels.addresses_of(self.model, data), data.xpos, data.xmat, data.xquat, data.cvel, data.subtree_com,
            data.xfrc_applied, data.qpos, data.qvel, data.qfrc_constraint, data.actuator_force,
            data.sensordata[3:],  # after the accelerometer
            np.array([self.model.body(f"{code}_wheel").id for code in WHEELS], np.int64),
        )  # fmt: skip
        damping = vehicle.suspension.damping_n_s_m, vehicle.steering.damping_n_m_s_rad, vehicle.drive.damping_n_m_s_rad
        self._servos = kernels.Servos(
            vehicle.drive.gain_n_m_s_rad, vehicle.drive.torque_limit_n_m, np.array(damping, float)
        )
        soil_wheels = [Wheel(wheel.outer_radius_m, wheel.width_m) for wheel in vehicle.wheels]
        self._slips = np.zeros(count)  # recent slips of the wheels
        self._wheels = Bodies(
            np.array([wheel.numbers() for wheel in soil_wheels]), np.zeros((count, 3)), np.zeros((count, 3, 3)),
            np.zeros((count, 3)), np.zeros((count, 3)), self._slips,
        )  # fmt: skip
        self._loads = Loads.zeros(count)
        shape = len(self.rocks) + 1, len(PARTS)
        self._records = kernels.Records(
            np.zeros(kernels.SIZE), np.full(shape, NO_CONTACT), np.full(shape, NO_CONTACT), np.zeros(shape, int),
            np.zeros(shape),
        )  # fmt: skip
        self._bulldozing = Bulldozing.on(self.ground.cell, max(round(EVERY_S / self.dt), 1))
        self._energy_zero = 0.0
        self._reach = max(wheel.reach for wheel in soil_wheels)
        self._radii = np.array([wheel.outer_radius_m for wheel in vehicle.wheels])
        self._wheels_xy = [(x, y) for x, y, _ in vehicle.wheel_centres.tolist()]
        self._steer_limit = math.radians(vehicle.steering.limit_deg)
        ground, reach = self.ground, self._reach + EDGE_MARGIN_M
        self._inside = (ground.x0 + reach, ground.y0 + reach, ground.x[-1] - reach, ground.y[-1] - reach)

    def _run(self, steps: int) -> None:
        self._kernels.advance(
            self._physics, self._servos, self.ground, self._wheels, self._law, self._bulldozing, self._loads,
            self._records, steps, self.steps, self.dt,
        )  # fmt: skip
        self.steps += steps

    def _put_down(self, start: Start) -> None:
        """Place the rover parallel to the slope below the wheels, with no wheel below the ground or a rock."""
        rotation = np.array(
            [[math.cos(start.heading), -math.sin(start.heading)], [math.sin(start.heading), math.cos(start.heading)]]
        )
        centres = self.vehicle.wheel_centres[:, :2] @ rotation.T + (start.x, start.y)
        self._require_inside(centres)
        supports = np.array([self._support(x, y) for x, y in centres])
        # Plane through the support points of the wheels, in a frame with the rover's heading.
        points = self.vehicle.wheel_centres
        plane = np.column_stack([points[:, :2], np.ones(len(points))])
        along, across, _ = np.linalg.lstsq(plane, supports, rcond=None)[0]
        up = np.array([-along, -across, 1.0]) / math.sqrt(1 + along**2 + across**2)
        forward = np.array([1.0, 0.0, along]) / math.hypot(1.0, along)
        level_from_base = np.stack([forward, np.cross(up, forward), up], axis=1)
        z = max(supports + self._radii / up[2] - (points @ level_from_base.T)[:, 2])
        attitude = Rotation.from_euler("z", start.heading) * Rotation.from_matrix(level_from_base)
        self.data.qpos[:3] = start.x, start.y, z
        self.data.qpos[3:7] = attitude.as_quat()[[3, 0, 1, 2]]
        self._mujoco.mj_step1(self.model, self.data)
        self._energy_zero = self._mechanical()

    def _support(self, x: float, y: float) -> float:
        """Return the height of the highest ground under a wheel's centre, or the top of a rock there."""
        column = round((x - self.ground.x0) / self.ground.cell)
        row = round((y - self.ground.y0) / self.ground.cell)
        near = math.ceil(0.12 / self.ground.cell)
        part = slice(max(row - near, 0), row + near + 1), slice(max(column - near, 0), column + near + 1)
        top = float(self.ground.level[part].max())
        rocks = self.world.rocks
        close = np.hypot(rocks["x_m"] - x, rocks["y_m"] - y) < rocks["radius_m"] + self._reach
        for rock in rocks.loc[close, "rock"]:
            top = max(top, float(self.world.rock_mesh(int(rock))[0][:, 2].max()))
        return top

    def _steer(self, seconds: float) -> None:
        """Set the servos to the command, within the vehicle's limits."""
        angles, rims = steer(self.command, self._wheels_xy, self.vehicle.wheelbase, self._steer_limit)
        max_turn = math.radians(self.vehicle.steering.rate_deg_s) * seconds
        now: list[float] = self.data.ctrl.tolist()
        max_speed_change = self.vehicle.drive.acceleration_m_s2 * seconds
        for wheel, radius in enumerate(self._radii.tolist()):
            now[wheel] = _towards(now[wheel], angles[wheel], max_turn)
            now[4 + wheel] = _towards(now[4 + wheel], rims[wheel] / radius, max_speed_change / radius)
        self.data.ctrl[:] = now
        # A speed servo creeps under load, so stationary wheels are braked.
        braked = not (any(rims) or any(now[4:]))
        self.model.dof_frictionloss[6 + SPIN :: 3] = self.vehicle.drive.brake_torque_n_m if braked else 0.0

    def _mechanical(self) -> float:
        """Return the kinetic and potential energy, including the springs, J."""
        return float(self.data.energy[0] + self.data.energy[1])

    def _wheel_table(self) -> np.ndarray:
        """Return (4, len(WHEEL_COLUMNS)) of the current state."""
        table = np.empty((len(WHEELS), len(WHEEL_COLUMNS)))
        self._kernels.describe(self._physics, self.ground, self._wheels.shapes, self._loads, table)
        geoms = self.data.contact.geom.ravel().tolist()
        on_rock = {self._wheel_of_geom[geom] for geom in geoms} - {NO_WHEEL}
        table[list(on_rock), WHEEL_COLUMNS.index("contact")] += CONTACTS.index("rock")
        return table


def _towards(now: float, target: float, max_change: float) -> float:
    return now + min(max(target - now, -max_change), max_change)
