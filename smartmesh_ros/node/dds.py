"""The Fast DDS settings that large maps need."""

import os
from pathlib import Path

from ament_index_python.packages import get_package_share_directory

VARIABLE = "FASTRTPS_DEFAULT_PROFILES_FILE"


def use_large_message_profile() -> None:
    """Has this process and those it starts use the package's ``config/fastdds.xml``, unless another profile is set.

    Works before the first node is made only, because Fast DDS reads its settings once.
    """
    os.environ.setdefault(VARIABLE, str(Path(get_package_share_directory("smartmesh_ros")) / "config" / "fastdds.xml"))
