"""The Fast DDS settings that large maps need, and those of a node that must not wait for its peers."""

import os
from pathlib import Path

from ament_index_python.packages import get_package_share_directory

# Has the profile's memory policy respected: buffers as large as the messages, and only while they are needed.
POLICY_VARIABLE = "RMW_FASTRTPS_USE_QOS_FROM_XML"
VARIABLE = "FASTRTPS_DEFAULT_PROFILES_FILE"
TRANSPORTS_VARIABLE = "FASTDDS_BUILTIN_TRANSPORTS"


def use_large_message_profile() -> None:
    """Has this process and those it starts use the package's ``config/fastdds.xml``, unless another profile is set.

    Works before the first node is made only, because Fast DDS reads its settings once.
    """
    if VARIABLE in os.environ:
        return
    os.environ[POLICY_VARIABLE] = "1"
    os.environ[VARIABLE] = str(Path(get_package_share_directory("smartmesh_ros")) / "config" / "fastdds.xml")


def send_without_waiting() -> None:
    """Has this process drop datagrams that the network does not take at once; what is reliable is sent again later.

    Otherwise a send to a machine that was cut off waits until the kernel gives it up, for seconds, and the physics with
    it. Left as it is where the variable is set, or a profile has transports of its own. Works before the first node is
    made only.
    """
    os.environ.setdefault(TRANSPORTS_VARIABLE, "DEFAULT?non_blocking=true")
