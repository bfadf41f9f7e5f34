"""URDFs of robots on legs from boxes and balls, with the main dimensions and masses of real ones."""

from dataclasses import dataclass
from typing import NamedTuple

from smartmesh_ros import BodyState, JointCommand, World
from smartmesh_ros.world.bodies import Body
from tests import urdfs
from tests.urdfs import Edges, box, joint, link

SIDES = {"left": 1.0, "right": -1.0}


class Robot(NamedTuple):
    """A robot's URDF, the positions at which its joints are held [rad], and the height of its root's centre of mass
    above the ground in this stance [m]."""

    urdf: str
    stance: dict[str, float]
    height: float


def motor(name: str, parent: str, child: str, at: str, effort: float) -> str:
    """A joint about y at ``at`` [m] of its parent, with a motor of this effort [N m]."""
    limit = f'<limit lower="-3" upper="3" effort="{effort}" velocity="20"/>'
    return joint(name, "revolute", parent, child, limit, at)


@dataclass(frozen=True, kw_only=True)
class Quadruped:
    """Four legs with hips and knees. ``hip`` [m]: x and y of the hips; ``thigh``, ``shank`` [m]; masses of the trunk, a
    thigh and a shank with its foot [kg]; ``foot`` [m]: its radius. ``bare``: nothing collides with the trunk."""

    trunk: Edges
    hip: tuple[float, float]
    thigh: float
    shank: float
    masses: tuple[float, float, float]
    foot: float
    bare: bool = False

    def build(self) -> Robot:
        """Return the robot on legs that are bent by 0.7 rad."""
        width = 2.0 * self.foot
        heavy, thigh, shank = self.masses
        parts, stance = [link("trunk", "" if self.bare else box(self.trunk), heavy, self.trunk)], {}
        size, low = (width, width, self.thigh), (width, width, self.shank)
        for end, x in (("front", self.hip[0]), ("hind", -self.hip[0])):
            for side, sign in SIDES.items():
                leg = f"{end}_{side}"
                parts += [
                    motor(f"{leg}_hip", "trunk", f"{leg}_thigh", f"{x} {sign * self.hip[1]} 0", 20.0 * heavy),
                    link(f"{leg}_thigh", box(size), thigh, size, at=f"0 0 {-0.5 * self.thigh}"),
                    motor(f"{leg}_knee", f"{leg}_thigh", f"{leg}_shank", f"0 0 {-self.thigh}", 20.0 * heavy),
                    link(f"{leg}_shank", "", 0.7 * shank, low, at=f"0 0 {-0.5 * self.shank}"),
                    joint(f"{leg}_ankle", "fixed", f"{leg}_shank", f"{leg}_foot", xyz=f"0 0 {-self.shank}"),
                    link(f"{leg}_foot", f'<sphere radius="{self.foot}"/>', 0.3 * shank, (width,) * 3),
                ]
                stance |= {f"{leg}_hip": 0.7, f"{leg}_knee": -1.4}
        height = (self.thigh + self.shank) * 0.7648 + self.foot
        return Robot(urdfs.robot(*parts), stance, height)


@dataclass(frozen=True, kw_only=True)
class Humanoid:
    """Two legs with hips, knees and ankles under a torso. ``hip`` [m]: y of the hips; ``foot`` [m]: a box; masses of
    the torso, a thigh, a shank and a foot [kg]. ``bare``: nothing collides with torso and thighs."""

    torso: Edges
    hip: float
    thigh: float
    shank: float
    foot: Edges
    masses: tuple[float, float, float, float]
    bare: bool = False

    def build(self) -> Robot:
        """Return the robot on slightly bent legs."""
        heavy, thigh, shank, foot = self.masses
        size, low = (0.08, 0.08, 0.8 * self.thigh), (0.06, 0.06, 0.8 * self.shank)
        torso, upper = ("", "") if self.bare else (box(self.torso), box(size))
        parts, stance = [link("pelvis", torso, heavy, self.torso, at=f"0 0 {0.5 * self.torso[2]}")], {}
        for side, sign in SIDES.items():
            parts += [
                motor(f"{side}_hip", "pelvis", f"{side}_thigh", f"0 {sign * self.hip} 0", 40.0 * heavy),
                link(f"{side}_thigh", upper, thigh, size, at=f"0 0 {-0.5 * self.thigh}"),
                motor(f"{side}_knee", f"{side}_thigh", f"{side}_shank", f"0 0 {-self.thigh}", 40.0 * heavy),
                link(f"{side}_shank", box(low), shank, low, at=f"0 0 {-0.5 * self.shank}"),
                motor(f"{side}_ankle", f"{side}_shank", f"{side}_foot", f"0 0 {-self.shank}", 40.0 * heavy),
                link(f"{side}_foot", box(self.foot), foot, self.foot, at=f"0.02 0 {-0.5 * self.foot[2]}"),
            ]
            stance |= {f"{side}_hip": -0.2, f"{side}_knee": 0.4, f"{side}_ankle": -0.2}
        height = (self.thigh + self.shank) * 0.9801 + self.foot[2] + 0.5 * self.torso[2]
        return Robot(urdfs.robot(*parts), stance, height)


MODELS: dict[str, Quadruped | Humanoid] = {
    "anymal": Quadruped(
        trunk=(0.53, 0.27, 0.24), hip=(0.30, 0.19), thigh=0.285, shank=0.33, masses=(27.0, 3.5, 1.2), foot=0.03
    ),
    "solo": Quadruped(
        trunk=(0.40, 0.11, 0.06), hip=(0.195, 0.124), thigh=0.16, shank=0.16, masses=(1.5, 0.15, 0.04), foot=0.017,
        bare=True,
    ),
    "g1": Humanoid(
        torso=(0.15, 0.2, 0.55), hip=0.12, thigh=0.30, shank=0.30, foot=(0.2, 0.07, 0.04), masses=(20.0, 4.5, 2.0, 0.7),
        bare=True,
    ),
    "talos": Humanoid(
        torso=(0.3, 0.4, 0.7), hip=0.085, thigh=0.38, shank=0.325, foot=(0.21, 0.13, 0.1), masses=(55.0, 10.0, 5.0, 3.0)
    ),
}  # fmt: skip


def robot(name: str) -> Robot:
    """Return one of the `MODELS`."""
    return MODELS[name].build()


def set_up(world: World, name: str, x: float, y: float, gap: float) -> Body:
    """Spawn one of the `MODELS` with its feet in a ``gap`` above the level z = 0 [m], whose joints hold its stance."""
    model = robot(name)
    world.spawn_robot(name, model.urdf, BodyState((x, y, model.height + gap)))
    body = world.bodies[name]
    for motor_name, position in model.stance.items():
        world.client.resetJointState(body.uid, body.joints[motor_name], position)
        world.command(name, motor_name, JointCommand(position=position))
    return body
