"""Installs the ament_python package smartmesh_ros."""

import sys
from pathlib import Path

from setuptools import find_packages, setup

NAME = "smartmesh_ros"

# For `ros2 run`. A wheel would put them onto everybody's path, where `view` is vim's.
IN_WORKSPACES = [
    f"fleet_front = {NAME}.starting:fleet_front",
    f"tune = {NAME}.tune.cli:start",
    f"view = {NAME}.starting:view",
]
IS_WHEEL = bool({"bdist_wheel", "dist_info"} & {*sys.argv})


def files(folder: str, pattern: str) -> list[str]:
    """Files of a folder, as setuptools wants them: relative to this one."""
    return sorted(str(path) for path in Path(folder).glob(pattern) if path.is_file())


setup(
    name=NAME,
    version="0.1.0",
    packages=find_packages(include=[NAME, f"{NAME}.*"]),
    package_data={NAME: ["py.typed", "studies/scenes/*.yaml"]},
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{NAME}"]),
        (f"share/{NAME}", ["package.xml"]),
        (f"share/{NAME}/config", files("config", "*")),
        (f"share/{NAME}/launch", files("launch", "*.launch.py")),
    ],
    python_requires=">=3.10",
    install_requires=["numba", "numpy", "pybullet"],
    extras_require={
        "bags": ["rosbags"],
        "files": ["pillow", "rasterio"],
        "studies": ["coal", "matplotlib", "mujoco", "psutil", "sapien"],
        "test": ["hypothesis", "pytest"],
        "tune": ["matplotlib", "optuna", "rosbags"],
        "view": ["viser[urdf]"],
    },
    zip_safe=False,
    maintainer="smartmesh_ros maintainers",
    maintainer_email="maintainers@smartmesh-ros.invalid",
    description="Collide with terrain that moves: small, velocity-carrying collider patches that follow bodies.",
    long_description=Path("README.md").read_text(),
    long_description_content_type="text/markdown",
    license="Apache-2.0",
    entry_points={
        "console_scripts": [
            f"terrain_collider = {NAME}.starting:terrain_collider",
            f"smartmesh-fleet = {NAME}.starting:fleet",
            f"terrain_source = {NAME}.starting:terrain_source",
            f"smartmesh-demo = {NAME}.starting:demo",
            f"smartmesh-studies = {NAME}.studies.cli:main",
            f"smartmesh-tune = {NAME}.tune.cli:start",
            f"smartmesh-view = {NAME}.starting:view",
            *([] if IS_WHEEL else IN_WORKSPACES),
        ],
    },
)
