"""Starts the collider with inputs from an elevation mapping stack (grid map) and a robot (odometry)."""

from launch.actions import DeclareLaunchArgument

from launch import LaunchDescription
from smartmesh_ros.startup.launching import description


def generate_launch_description() -> LaunchDescription:
    """Return the launch description."""
    return description(
        DeclareLaunchArgument(
            "grid_map", default_value="/elevation_mapping/elevation_map", description="Topic of the grid map."
        ),
        DeclareLaunchArgument("odometry", default_value="/odom", description="Topic of the robot's odometry."),
        always="elevation_mapping",
        remap=[("~/grid_map", "grid_map"), ("~/tracked_odometry", "odometry")],
    )
