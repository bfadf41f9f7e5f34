"""Fast DDS settings: for large maps, and for sending without blocking."""

import os
from pathlib import Path

from ament_index_python.packages import get_package_share_directory

# Makes rmw_fastrtps apply the profile's memory policy: buffers have the size of their message and are freed after use.
POLICY_VARIABLE = "RMW_FASTRTPS_USE_QOS_FROM_XML"
VARIABLE = "FASTRTPS_DEFAULT_PROFILES_FILE"
TRANSPORTS_VARIABLE = "FASTDDS_BUILTIN_TRANSPORTS"


def use_large_message_profile() -> None:
    """Set the package's ``config/fastdds.xml`` for this process and its children, unless another profile is set.

    Takes effect only before the first node is created, because Fast DDS reads its settings once.
    """
    if VARIABLE in os.environ:
        return
    os.environ[POLICY_VARIABLE] = "1"
    os.environ[VARIABLE] = str(Path(get_package_share_directory("smartmesh_ros")) / "config" / "fastdds.xml")


def send_without_waiting() -> None:
    """Make this process drop datagrams that the network does not accept at once; DDS resends reliable messages later.

    Otherwise a send to a disconnected machine blocks the physics for seconds, until the kernel gives up. No effect if
    the variable is set already or a profile has its own transports. Takes effect only before the first node is created.
    """
    os.environ.setdefault(TRANSPORTS_VARIABLE, "DEFAULT?non_blocking=true")
