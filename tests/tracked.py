"""Tracked machines."""

from smartmesh_ros import BodyState, HeightMap, World
from smartmesh_ros.scenes.tracks import robot_file
from tests.grounds import world_of

NAME = "machine"
UNDERCARRIAGE = robot_file().read_text()
# A chassis of 60 kg and two boxes of 20 kg as tracks, all of whose corners carry the load.
BOXES = """<robot name="boxes"><link name="base"><inertial><mass value="60"/>
<inertia ixx="3" iyy="5" izz="7" ixy="0" ixz="0" iyz="0"/></inertial></link>
{}{}</robot>"""
SIDE = """<link name="{name}"><inertial><mass value="20"/>
<inertia ixx="0.2" iyy="1.2" izz="1.2" ixy="0" ixz="0" iyz="0"/></inertial>
<collision><geometry><box size="1.2 0.2 0.3"/></geometry></collision></link>
<joint name="{name}_joint" type="fixed"><parent link="base"/><child link="{name}"/><origin xyz="0 {y} -0.1"/></joint>
<surface_drive name="{name}_track" link="{name}"><axis xyz="0 1 0"/><limit velocity="2"/></surface_drive>"""
FLAT_TRACKS = BOXES.format(SIDE.format(name="left", y=0.4), SIDE.format(name="right", y=-0.4))
STANDING = 120  # steps until a machine stands


def standing(ground: HeightMap, urdf: str = UNDERCARRIAGE, *, friction: float = 1.0) -> World:
    world = world_of(ground, friction=friction, sleep=False)
    world.spawn_robot(NAME, urdf, BodyState((0.0, 0.0, 0.0)), on_ground=True, align=True)
    world.step(STANDING)
    return world


def drive(world: World, left: float, right: float) -> None:
    world.drive(NAME, "left_track", left)
    world.drive(NAME, "right_track", right)
