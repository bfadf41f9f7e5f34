"""Starts the collider and, unless told otherwise, a terrain source to try it with."""

from launch.actions import DeclareLaunchArgument, SetEnvironmentVariable
from launch.conditions import IfCondition
from launch.substitutions import LaunchConfiguration, PathJoinSubstitution
from launch_ros.actions import Node
from launch_ros.substitutions import FindPackageShare

from launch import LaunchDescription


def generate_launch_description() -> LaunchDescription:
    """The launch description."""
    config = PathJoinSubstitution([FindPackageShare("smartmesh_ros"), "config", LaunchConfiguration("config")])
    profile = PathJoinSubstitution([FindPackageShare("smartmesh_ros"), "config", "fastdds.xml"])
    return LaunchDescription(
        [
            DeclareLaunchArgument("config", default_value="rover.yaml", description="Parameter file in config/."),
            DeclareLaunchArgument("source", default_value="true", description="Whether to start terrain_source."),
            DeclareLaunchArgument("scene", default_value="waves", description="Scene of terrain_source."),
            DeclareLaunchArgument("rviz", default_value="false", description="Whether to start RViz."),
            DeclareLaunchArgument("dds", default_value=profile, description="Fast DDS settings, an XML file."),
            SetEnvironmentVariable("FASTRTPS_DEFAULT_PROFILES_FILE", LaunchConfiguration("dds")),
            SetEnvironmentVariable("RMW_FASTRTPS_USE_QOS_FROM_XML", "1"),
            Node(
                package="smartmesh_ros",
                executable="terrain_collider",
                output="screen",
                parameters=[config],
            ),
            Node(
                package="smartmesh_ros",
                executable="terrain_source",
                output="screen",
                parameters=[{"scene": LaunchConfiguration("scene")}],
                condition=IfCondition(LaunchConfiguration("source")),
            ),
            Node(
                package="rviz2",
                executable="rviz2",
                arguments=["-d", PathJoinSubstitution([FindPackageShare("smartmesh_ros"), "config", "smartmesh.rviz"])],
                condition=IfCondition(LaunchConfiguration("rviz")),
            ),
        ]
    )
