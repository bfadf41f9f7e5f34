"""Robots as URDF text, with masses that the tests know."""

WHEEL_RADIUS = 0.15
# Body and four wheels [kg].
ROVER_MASS = 10.0 + 4 * 1.0
WHEELS = ("front_left", "front_right", "rear_left", "rear_right")
PLACES = {
    "front_left": (0.3, 0.25),
    "front_right": (0.3, -0.25),
    "rear_left": (-0.3, 0.25),
    "rear_right": (-0.3, -0.25),
}
    "front_left": (0.3, 0.25),
    "front_right": (0.3, -0.25),
    "rear_left": (-0.3, 0.25),
    "rear_right": (-0.3, -0.25),
}


def rover(name: str = "rover", body_mass: float = 10.0) -> str:
    """Four driven wheels; the centre of mass of the body lies 0.1 m ahead of and 0.05 m below its frame."""
    wheels = "".join(
        f"""
  <link name="{wheel}_wheel">
    <inertial><origin rpy="1.5707963 0 0"/><mass value="1"/>
      <inertia ixx="0.006" iyy="0.006" izz="0.011" ixy="0" ixz="0" iyz="0"/></inertial>
    <collision><geometry><sphere radius="{WHEEL_RADIUS}"/></geometry></collision>
  </link>
  <joint name="{wheel}" type="continuous">
    <parent link="base_link"/><child link="{wheel}_wheel"/>
    <origin xyz="{PLACES[wheel][0]} {PLACES[wheel][1]} 0"/><axis xyz="0 1 0"/>
    <limit effort="20" velocity="50"/>
  </joint>"""
        for wheel in WHEELS
    )
    return f"""<robot name="{name}">
  <link name="base_link">
    <inertial><origin xyz="0.1 0 -0.05"/><mass value="{body_mass}"/>
      <inertia ixx="0.3" iyy="0.5" izz="0.6" ixy="0" ixz="0" iyz="0"/></inertial>
    <collision><origin xyz="0 0 0.1"/><geometry><box size="0.7 0.35 0.1"/></geometry></collision>
  </link>{wheels}
</robot>"""
