"""Starts the collider on the grid map of an elevation mapping stack and the odometry of a robot."""

from launch.actions import DeclareLaunchArgument
from launch.substitutions import LaunchConfiguration, PathJoinSubstitution
from launch_ros.actions import Node
from launch_ros.substitutions import FindPackageShare

from launch import LaunchDescription


def generate_launch_description() -> LaunchDescription:
    """The launch description."""
    config = PathJoinSubstitution([FindPackageShare("smartmesh_ros"), "config", "elevation_mapping.yaml"])
    return LaunchDescription(
        [
            DeclareLaunchArgument("params_file", default_value=config, description="Parameter file of the node."),
            DeclareLaunchArgument(
                "grid_map", default_value="/elevation_mapping/elevation_map", description="Topic of the grid map."
            ),
            DeclareLaunchArgument("odometry", default_value="/odom", description="Topic of the robot's odometry."),
            Node(
                package="smartmesh_ros",
                executable="terrain_collider",
                output="screen",
                parameters=[LaunchConfiguration("params_file")],
                remappings=[
                    ("~/grid_map", LaunchConfiguration("grid_map")),
                    ("~/odometry", LaunchConfiguration("odometry")),
                ],
            ),
        ]
    )
