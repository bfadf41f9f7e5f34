"""The Fast DDS settings that large maps need."""

import os
from pathlib import Path

from ament_index_python.packages import get_package_share_directory

# Has the profile's memory policy respected: buffers as large as the messages, and only while they are needed.
POLICY_VARIABLE = "RMW_FASTRTPS_USE_QOS_FROM_XML"
VARIABLE = "FASTRTPS_DEFAULT_PROFILES_FILE"


def use_large_message_profile() -> None:
    """Has this process and those it starts use the package's ``config/fastdds.xml``, unless another profile is set.

    Works before the first node is made only, because Fast DDS reads its settings once.
    """
    if VARIABLE in os.environ:
        return
    os.environ[POLICY_VARIABLE] = "1"
    os.environ[VARIABLE] = str(Path(get_package_share_directory("smartmesh_ros")) / "config" / "fastdds.xml")
