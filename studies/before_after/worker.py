"""One side of the comparison: a process that runs cases with the smartmesh_ros of its PYTHONPATH.

This script uses only the package's public API, so that it runs with other versions of the package. It reads a line of
JSON for each piece from standard input, and answers with a line of JSON.
"""

from __future__ import annotations

import argparse
import gc
import json
import os
import sys
import traceback
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from time import perf_counter, process_time
from types import BuiltinFunctionType
from typing import Any

import numpy as np
import pybullet as pb
from numpy.typing import NDArray

# A sample of all positions every so many steps.
EVERY = 10


@dataclass
class Meter:
    """Time [s] and number of calls since the last `take`. ``clock``: function that returns the time; ``offset`` [s]:
    time of two clock readings, which is subtracted."""

    clock: Callable[[], float]
    offset: float = field(init=False)
    time: float = 0.0
    calls: int = 0

    def __post_init__(self) -> None:
        pairs = [(self.clock(), self.clock()) for _ in range(2000)]
        self.offset = float(np.median([end - begin for begin, end in pairs]))

    def take(self) -> tuple[float, int]:
        """Return time and number of calls, and reset both to zero."""
        found = self.time, self.calls
        self.time, self.calls = 0.0, 0
        return found


class Metered:
    """A function of PyBullet whose calls are timed; it passes for a builtin one, which `BulletClient` asks for."""

    def __init__(self, function: Callable[..., Any], meter: Meter) -> None:
        self._function, self._meter = function, meter

    @property  # type: ignore[misc]
    def __class__(self) -> type:
        return BuiltinFunctionType

    def __call__(self, *arguments: Any, **named: Any) -> Any:
        meter = self._meter
        begin = meter.clock()
        try:
            return self._function(*arguments, **named)
        finally:
            meter.time += meter.clock() - begin - meter.offset
            meter.calls += 1


def meter_bullet(clock: Callable[[], float], *, all_calls: bool) -> tuple[Meter, Meter]:
    """Time ``stepSimulation``, and with ``all_calls`` all other functions too. Call this before any other module
    imports PyBullet's functions."""
    stepping, others = Meter(clock), Meter(clock)
    for name, function in list(vars(pb).items()):
        if name == "stepSimulation":
            setattr(pb, name, Metered(function, stepping))
        elif all_calls and isinstance(function, BuiltinFunctionType):
            setattr(pb, name, Metered(function, others))
    return stepping, others


class GroundDriver:
    """`Ground` in a PyBullet world: patches are refreshed in every fourth step, and extrapolated in the others."""

    steps_per_update = 4

    def __init__(self, case: dict[str, Any], first: NDArray[np.float32], starts: NDArray[np.float64]) -> None:
        from pybullet_utils.bullet_client import BulletClient

        from smartmesh_ros import Ground, PatchConfig

        self.dt = 1.0 / case["rate"]
        self.client: Any = BulletClient(pb.DIRECT)
        self.client.setGravity(0.0, 0.0, -9.81)
        self.client.setTimeStep(self.dt)
        self.client.setPhysicsEngineParameter(
            numSolverIterations=50, solverResidualThreshold=1e-7, contactBreakingThreshold=2e-4, erp=0.3, contactERP=0.3
        )
        if case["shape"] == "sphere":
            shape = self.client.createCollisionShape(pb.GEOM_SPHERE, radius=case["size"][0])
        else:
            shape = self.client.createCollisionShape(pb.GEOM_BOX, halfExtents=[0.5 * edge for edge in case["size"]])
        self.heightmap = height_map(case, first)
        ground = Ground(self.client, self.heightmap, PatchConfig(kind=case["kind"]))
        self.uids = [self.client.createMultiBody(1.0, shape, -1, start) for start in starts.tolist()]
        for uid in self.uids:
            self.client.changeDynamics(
                uid, -1, lateralFriction=0.5, restitution=0.0, linearDamping=0.0, angularDamping=0.0
            )
            ground.attach(uid)
        self._ground = ground
        self._steps = 0

    @property
    def time(self) -> float:
        """Simulated time [s]."""
        found: float = self._steps * self.dt
        return found

    def step(self) -> None:
        time = self.time
        if self._steps % self.steps_per_update == 0:
            self._ground.update(time, self.dt, self.steps_per_update)
        else:
            self._ground.go_on(time, self.dt)
        self.client.stepSimulation()
        self._steps += 1

    def close(self) -> None:
        self.client.disconnect()


class WorldDriver:
    """`World` with its defaults: patches at 60 Hz and when maps come, landing, guard."""

    def __init__(self, case: dict[str, Any], first: NDArray[np.float32], starts: NDArray[np.float64]) -> None:
        from smartmesh_ros import BodyState, Box, PatchConfig, PhysicsConfig, Sphere, World, WorldConfig

        self.heightmap = height_map(case, first)
        physics = PhysicsConfig(rate=case["rate"])
        self.world = World(self.heightmap, WorldConfig(physics=physics, patch=PatchConfig(kind=case["kind"])))
        shape: Any = Sphere(*case["size"]) if case["shape"] == "sphere" else Box(*case["size"])
        for index, (x, y, z) in enumerate(starts.tolist()):
            self.world.spawn(f"body_{index}", shape, 1.0, BodyState((x, y, z)))
        self.client = self.world.client
        self.uids = [body.uid for body in self.world.bodies.values()]

    @property
    def time(self) -> float:
        """Simulated time [s]."""
        return float(self.world.time)

    def step(self) -> None:
        self.world.step()

    def close(self) -> None:
        self.world.close()


class RobotsDriver:
    """`World` with its defaults and robots in it, which never sleep."""

    def __init__(self, case: dict[str, Any], first: NDArray[np.float32], starts: NDArray[np.float64]) -> None:
        from smartmesh_ros import BodyState, PatchConfig, PhysicsConfig, World, WorldConfig

        self.heightmap = height_map(case, first)
        physics = PhysicsConfig(rate=case["rate"], sleep=False)
        self.world = world = World(self.heightmap, WorldConfig(physics=physics, patch=PatchConfig(kind=case["kind"])))
        self.client = world.client
        for index, (x, y, z) in enumerate(starts.tolist()):
            name = f"robot_{index}"
            world.spawn_robot(name, case["urdf"], BodyState((x, y, z)))
            body = world.bodies[name]
            for joint, position in case["positions"].items():
                self.client.resetJointState(body.uid, body.joints[joint], position, 0.0)
                world.command(name, joint, self._command(position=position))
            for joint, velocity in case["velocities"].items():
                world.drive(name, joint, velocity)
            world.ground.placed(body.uid)
        self.uids = [body.uid for body in world.bodies.values()]

    @staticmethod
    def _command(**target: float) -> Any:
        from smartmesh_ros.physics.joints import JointCommand

        return JointCommand(**target)

    @property
    def time(self) -> float:
        """Simulated time [s]."""
        return float(self.world.time)

    def step(self) -> None:
        self.world.step()

    def samples(self) -> dict[str, int]:
        """Return the number of samples of the field under each link, 0 = it has no field."""
        from smartmesh_ros.patches.supports import Support

        followers, supports = self.world.ground.followers, self.world.ground.supports
        found = {}
        for follower in followers:
            support = supports[follower.slot]
            is_field = int(support["state"]) == Support.FIELD
            found[follower.name] = int(support["rows"]) * int(support["columns"]) if is_field else 0
        return found

    def close(self) -> None:
        self.world.close()


Driver = GroundDriver | WorldDriver | RobotsDriver
DRIVERS: dict[str, type[Driver]] = {"ground": GroundDriver, "world": WorldDriver, "robots": RobotsDriver}


def height_map(case: dict[str, Any], first: NDArray[np.float32]) -> Any:
    """The map at time zero."""
    from smartmesh_ros import HeightMap

    return HeightMap(first, resolution=case["resolution"], origin=tuple(case["origin"]), time=0.0)


class Worker:
    """Runs pieces, each a whole case from its start."""

    def __init__(self, *, count_calls: bool) -> None:
        # The processor clock excludes other processes, but reading it around every call is too slow.
        self._clock = perf_counter if count_calls else process_time
        self._stepping, self._calls = meter_bullet(self._clock, all_calls=count_calls)
        self._offset = Meter(self._clock).offset

    def run(self, folder: Path, out: Path) -> None:
        """Writes what each step took [s] and where bodies were to ``out``."""
        case = json.loads((folder / "case.json").read_text())
        maps, starts = np.load(folder / "maps.npy"), np.load(folder / "starts.npy")
        driver = DRIVERS[case["driver"]](case, maps[0], starts)
        gc.collect()
        steps, rate, map_rate = round(case["seconds"] * case["rate"]), case["rate"], case["map_rate"]
        # Update, step, PyBullet's own calls [s]; their number; whether a map came; its share of the update [s].
        taken = np.empty((steps, 6))
        samples: list[tuple[float, Any]] = []
        fields: list[dict[str, int]] = []
        number = 0
        for step in range(steps):
            due = int((step / rate + case["early"]) * map_rate + 1e-6)
            # A copy, because no two messages share their memory.
            heights = maps[min(due, len(maps) - 1)].copy() if due != number else None
            # A world sums its time steps: a rounding error must not put a map into its future.
            stamp = min(due / map_rate, driver.time + case["early"]) if map_rate else 0.0
            taken[step] = self._one_step(driver, heights, stamp)
            number = due
            if step % EVERY == EVERY - 1:
                poses = [driver.client.getBasePositionAndOrientation(uid) for uid in driver.uids]
                samples.append(((step + 1) / rate, poses))
                fields.append(driver.samples() if isinstance(driver, RobotsDriver) else {})
        np.savez(
            out,
            taken=taken,
            times=[time for time, _ in samples],
            positions=np.array([[pose[0] for pose in poses] for _, poses in samples]),
            orientations=np.array([[pose[1] for pose in poses] for _, poses in samples]),
            links=list(fields[0]),
            fields=np.array([list(counts.values()) for counts in fields]),
        )
        driver.close()

    def _one_step(self, driver: Driver, heights: Any, time: float) -> tuple[float, ...]:
        self._stepping.take(), self._calls.take()
        begin = self._clock()
        if heights is not None:
            driver.heightmap.replace(heights, time=time)
        received = self._clock() - begin - self._offset
        driver.step()
        whole = self._clock() - begin - self._offset
        stepping, (own, calls) = self._stepping.take()[0], self._calls.take()
        new = heights is not None
        return whole - stepping - 2.0 * self._offset, stepping, own, float(calls), float(new), received * new


def main() -> None:
    """Answers commands until standard input ends."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count-calls", action="store_true", help="time every call of PyBullet, which disturbs")
    options = parser.parse_args()
    # Redirect PyBullet's output, which must not mix with the answers.
    answers = os.fdopen(os.dup(1), "w", buffering=1)
    os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
    worker = Worker(count_calls=options.count_calls)
    import smartmesh_ros

    print(json.dumps({"package": smartmesh_ros.__file__}), file=answers)
    for line in sys.stdin:
        command = json.loads(line)
        try:
            worker.run(Path(command["folder"]), Path(command["out"]))
        except Exception:  # noqa: BLE001  the other side goes on, and the table says what failed
            print(json.dumps({"error": traceback.format_exc()}), file=answers)
        else:
            print(json.dumps({"error": ""}), file=answers)


if __name__ == "__main__":
    main()
