"""Starts the collider with inputs from an elevation mapping stack (grid map) and a robot (odometry)."""

from launch import LaunchDescription
from smartmesh_ros.startup.launching import argument, description


def generate_launch_description() -> LaunchDescription:
    """Return the launch description."""
    return description(
        argument("grid_map", "/elevation_mapping/elevation_map", "Topic of the grid map."),
        argument("odometry", "/odom", "Topic of the robot's odometry."),
        always="elevation_mapping",
        remap=[("~/grid_map", "grid_map"), ("~/tracked_odometry", "odometry")],
    )
