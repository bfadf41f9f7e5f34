"""Worlds at random, whose inputs are functions of a seed and of the step: what one does, any other repeats.

`python -m tests.world.random_worlds COUNT` saves COUNT of them at a random step, restores each in a new process, and
compares both runs to the bit.
"""

import ast
import hashlib
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

from smartmesh_ros import BodyState, Carrier, Deck, Material, MotionConfig, PhysicsConfig, Terrain, World, WorldConfig
from smartmesh_ros.ground.shapes import Box, Capsule, Cylinder, Sphere
from smartmesh_ros.scenes.tracks import robot_file
from smartmesh_ros.soil.soil import Soil
from smartmesh_ros.terrain.heightmap import HeightMap
from smartmesh_ros.terrain.trimesh import TriangleMesh, grid_triangles
from smartmesh_ros.world.joints import JointCommand
from tests.urdfs import HUSKY, ROVER

SIDE = 61
GROUNDS = ["still", "waves", "smooth", "cubics", "noisy waves", "corrections", "fused", "regions", "slides", "scrolls"]
MOTIONS = {
    "smooth": MotionConfig(smoothing=1.0), "cubics": MotionConfig(mode="interpolate"),
    "noisy waves": MotionConfig(noise=0.003), "corrections": MotionConfig(changes="correction"),
    "fused": MotionConfig(changes="correction", noise=0.005),
}  # fmt: skip


class RandomWorld:
    """A world of a ``seed``, or one that was ``saved`` by another process. `run` steps it from one step to another."""

    def __init__(self, seed: int, saved: Path | None = None) -> None:
        self.seed, rng = seed, np.random.default_rng(seed)
        self.kind = GROUNDS[seed % len(GROUNDS)]
        self.every = int(rng.integers(3, 25))  # steps from map to map
        self.spacing = float(rng.choice([0.08, 0.15, 0.2]))
        self.height = float(rng.choice([0.0, 0.05, 0.15]))
        self.decks = seed % 4 == 3  # not where there is soil
        self.soil = self.kind in ("still", "regions", "waves") and seed % 3 != 0
        self.tiles, self.folded = rng.random() < 0.4, rng.random() < 0.3
        self.robots = [robot for robot in (HUSKY, ROVER, str(robot_file())) if rng.random() < 0.3]
        if saved is not None:
            self.world = World()
            self.world.restore(saved)
            return
        config = WorldConfig(physics=PhysicsConfig(rate=float(rng.choice([120.0, 240.0, 500.0]))))
        self.world = World(self._terrain(rng), config)
        if self.soil:
            self.world.ground.set_soil(Soil(self.world.terrain, ["dry_sand", "clay"], spacing=0.02))
        self._fill(rng)

    def _origin(self, time: float) -> tuple[float, float]:
        half = 0.5 * (SIDE - 1) * self.spacing
        moved = {"slides": 0.05 * time, "scrolls": self.spacing * int(time / 0.5)}.get(self.kind, 0.0)
        return moved - half, -half

    def _heights(self, time: float) -> np.ndarray:
        x, y = self._origin(time)
        x, y = x + self.spacing * np.arange(SIDE), y + self.spacing * np.arange(SIDE)[:, None]
        if self.kind == "slides":
            x, time = x - 0.05 * time, 0.0
        found = self.height * np.sin(x - 2.0 * time) * np.cos(0.7 * y + 0.3 * time)
        found = found + 0.05 * (x * x + y * y)  # a bowl, in which bodies meet
        if self.kind in ("noisy waves", "corrections", "fused"):
            found = found + np.random.default_rng((self.seed, round(time * 1e6))).normal(0.0, 0.003, found.shape)
        return found

    def _map(self, time: float, **more: object) -> HeightMap:
        motion = MOTIONS.get(self.kind, MotionConfig())
        return HeightMap(
            self._heights(time), resolution=self.spacing, origin=self._origin(time), time=time, motion=motion, **more
        )  # type: ignore[arg-type]

    def _terrain(self, rng: np.random.Generator) -> Terrain:
        layers = {} if rng.random() < 0.5 else {"friction": rng.uniform(0.3, 1.2, (SIDE, SIDE))}
        if self.soil:
            layers["soil"] = rng.integers(0, 2, (SIDE, SIDE))
        if rng.random() < 0.3:
            stiffness, rolling = rng.uniform(1e6, 1e8, (SIDE, SIDE)), rng.uniform(0.0, 0.1, (SIDE, SIDE))
            layers["material"] = Material(stiffness=stiffness, damping=1e5, restitution=0.5, rolling=rolling)
        terrain = Terrain(self._map(0.0, **layers))
        if self.tiles:
            x = -self._origin(0.0)[0] + self.spacing
            terrain.put("beside", HeightMap(np.zeros((30, SIDE)), resolution=self.spacing, origin=(x, -2.0)))
        if self.folded:
            motion = MOTIONS[self.kind] if self.kind in ("smooth", "cubics") else MotionConfig()
            terrain.put("folded", TriangleMesh(self._vertices(0.0), grid_triangles(9, 9), motion=motion))
        return terrain

    def _vertices(self, time: float) -> np.ndarray:
        y, x = np.mgrid[:9, :9] * 0.2 - 0.8
        z = 0.35 + 0.1 * np.sin(3.0 * x + 2.0 * time) * np.cos(3.0 * y)
        return np.stack([x + 0.05 * np.sin(time), y, z], axis=-1).reshape(-1, 3)

    def _fill(self, rng: np.random.Generator) -> None:
        world = self.world
        for index, urdf in enumerate(self.robots):
            world.spawn_robot(f"robot_{index}", urdf, BodyState((-2.0 + 1.5 * index, -1.0, 0.6)))
        for index in range(int(rng.integers(2, 14))):
            sizes = rng.uniform(0.1, 0.4, 3).tolist()
            shapes = [
                Sphere(sizes[0]), Box(*sizes), Cylinder(height=sizes[0], radius=sizes[1]),
                Capsule(height=sizes[0], radius=sizes[1]),
            ]  # fmt: skip
            x, y = rng.uniform(-1.8, 1.8, 2).tolist()
            state = BodyState((x, y, rng.uniform(0.6, 1.5)), linear=tuple(rng.normal(0.0, 0.3, 3).tolist()))
            world.spawn(f"body_{index}", shapes[int(rng.integers(4))], float(rng.uniform(0.5, 30.0)), state)
        self.track_hand()
        if not self.decks:
            return
        for deck, carrier in (("ship", ""), ("bed", "body_0"), ("palm", "hand")):
            tile = HeightMap(np.zeros((9, 9)), resolution=0.1, origin=(-0.4, -0.4))
            world.terrain.put(deck, Deck(tile, thickness=0.1, position=(0.0, 0.0, 1.0)))
            if carrier:
                world.carry(deck, Carrier(carrier, position=(0.0, 0.0, 0.5)))

    def track_hand(self) -> None:
        self.world.track("hand", 0.3, BodyState((1.5, 1.5, 0.4), linear=(-0.1, 0.0, 0.0)))

    def _feed(self, step: int) -> None:
        world, time = self.world, self.world.time
        rng = np.random.default_rng((self.seed, step))
        if step % self.every == 0:
            tile = world.terrain.tiles[""]
            if self.kind in ("slides", "scrolls"):
                world.terrain.put("", self._map(time))
            elif self.kind == "regions":
                row, column = rng.integers(0, SIDE - 9, 2).tolist()
                tile.update_region(row, column, self._heights(time)[row : row + 9, column : column + 9], time=time)
            elif self.kind != "still":
                tile.replace(self._heights(time), time=time)
            if self.folded:
                world.terrain.tiles["folded"].move(self._vertices(time), time=time)
        if self.decks and step % self.every == 1:
            roll = 0.1 * np.sin(3.0 * time)
            turn = (np.sin(roll), 0.0, 0.0, np.cos(roll))
            world.terrain.deck("ship").move((0.3 * time, 0.0, 1.0 + roll), turn, time=time)
        if step % 50 == 10:
            for body in [body for body in world.bodies.values() if body.is_robot]:
                for joint in (*body.joints, *body.surfaces):
                    lasts = float(rng.choice([0.1, np.inf]))
                    world.command(body.name, joint, JointCommand(velocity=float(rng.normal(0.0, 1.0))), lasts)
        if step % 90 == 45:
            x, y = rng.uniform(-1.0, 1.0, 2).tolist()
            world.track("hand", 0.3, BodyState((x, y, 0.3), linear=(0.2, 0.0, 0.0)))
        if step % 230 == 100:
            world.spawn(f"late_{step}", Box(0.2, 0.2, 0.2), 3.0, BodyState((0.5, 0.5, 1.2)))
        if step % 310 == 200 and "body_1" in world.bodies:
            world.remove("body_1")

    def run(self, first: int, last: int) -> str:
        """Step from the step ``first`` to ``last``; return a digest of bodies and contacts on the way, and of the
        ground at the end."""
        found, world = hashlib.sha256(), self.world
        for step in range(first, last):
            self._feed(step)
            world.step()
            if step % 20 == 0 or step == last - 1:
                found.update(world.snapshot().hash.encode())
                found.update(repr(world.contacts()).encode())
        points = np.stack(np.meshgrid(*[np.linspace(-2.0, 2.0, 40)] * 2), axis=-1).reshape(-1, 2)
        for array in world.terrain.at(points, world.time):
            found.update(array.tobytes())
        return found.hexdigest()


def saved_run(seed: int, file: Path, most: int, more: int) -> tuple[int, str]:
    """Run a world to a random step of at most ``most``, save it, and return the step and the digest of ``more``
    steps."""
    it, at = RandomWorld(seed), int(np.random.default_rng((seed, 1)).integers(1, most))
    with it.world:
        it.run(0, at)
        it.world.save(file)
        return at, it.run(at, at + more)


def restored_runs(runs: dict[int, tuple[str, int]], more: int) -> dict[int, str]:
    """Return the digests of worlds, by their seeds, that go on from files at steps."""
    found = {}
    for seed, (file, at) in runs.items():
        it = RandomWorld(seed, Path(file))
        with it.world:
            found[seed] = it.run(at, at + more)
    return found


def digests_elsewhere(runs: dict[int, tuple[str, int]], more: int) -> dict[int, str]:
    """Return the same from a new process."""
    code = f"from tests.world.random_worlds import restored_runs; print('\\n', restored_runs({runs!r}, {more}))"
    told = subprocess.run([sys.executable, "-c", code], stdout=subprocess.PIPE, text=True, check=True, timeout=600)
    return dict(ast.literal_eval(told.stdout.splitlines()[-1].strip()))


def main(first: int, count: int) -> int:
    different = []
    with tempfile.TemporaryDirectory() as folder:
        for seed in range(first, first + count):
            file = f"{folder}/state.npz"
            at, digest = saved_run(seed, Path(file), 600, 1000)
            if digests_elsewhere({seed: (file, at)}, 1000) != {seed: digest}:
                different.append(seed)
                print(f"seed {seed}, step {at}: different", flush=True)
    print(f"{count - len(different)} of {count} worlds go on to the bit in a new process; different: {different}")
    return len(different)


if __name__ == "__main__":
    numbers = [int(number) for number in sys.argv[1:]]
    sys.exit(main(numbers[1] if len(numbers) > 1 else 0, numbers[0]) > 0)
