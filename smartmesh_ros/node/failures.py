"""Errors that a node with physics outlives."""

import pybullet as pb
from rclpy.impl.implementation_singleton import rclpy_implementation

from smartmesh_ros.errors import InputError

# What ends a message or call, and leaves the world as it was.
REFUSED = (InputError, pb.error)
# What may fail in a step or an output without ending the node.
FAILED = (pb.error, rclpy_implementation.RCLError)
