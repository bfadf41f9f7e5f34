"""Installs the ament_python package smartmesh_ros, with its C++ core."""

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

from setuptools import Distribution, find_packages, setup
from setuptools.command.build_py import build_py
from setuptools.command.develop import develop
from setuptools.command.install_lib import install_lib

NAME = "smartmesh_ros"
ROOT = Path(__file__).resolve().parent
sys.path.insert(0, str(ROOT))
import core_build  # noqa: E402

# Commands by their functions. A wheel puts them onto everybody's path, where `view` is vim's: smartmesh-view there.
COMMANDS = ("smartmesh", "terrain_collider", "terrain_score", "terrain_sensor", "terrain_source")
PREFIXED = ("demo", "fleet", "fleet_front", "replay", "rover", "tune", "view")
FOR_ROS2_RUN = ("fleet_front", "replay", "rover", "tune", "view")
IS_WHEEL = bool({"bdist_wheel", "dist_info"} & {*sys.argv})
# PyBullet has wheels for Linux up to Python 3.11. A fork of it has them for 3.12 and 3.13, and is imported by the same
# name. The markers are those of requirements/pybullet.txt.
PYBULLET = [
    'pybullet-arm64==3.2.8; platform_system == "Linux" and platform_machine == "x86_64"'
    ' and python_version >= "3.12" and python_version < "3.14"',
    'pybullet; platform_system != "Linux" or platform_machine != "x86_64"'
    ' or python_version < "3.12" or python_version >= "3.14"',
]
# Prints whether PyBullet is there, and which packages it is from.
ASK = """
import json
from importlib.metadata import packages_distributions
from importlib.util import find_spec
there = find_spec("pybullet") is not None
packages = packages_distributions().get("pybullet", []) if there else []
print(json.dumps({"there": there, "packages": sorted(set(packages))}))
"""


def installed_pybullet() -> list[str] | None:
    """Return the packages of the PyBullet in the environment that this one is installed into, None without PyBullet.

    pip builds in an environment that holds the build's requirements alone, which two variables set up.
    """
    outside = {name: value for name, value in os.environ.items() if name not in ("PYTHONPATH", "PYTHONNOUSERSITE")}
    for variables in ({**os.environ}, outside):
        command = [sys.executable, "-c", ASK]
        found = json.loads(subprocess.run(command, env=variables, stdout=subprocess.PIPE, check=True).stdout)
        if found["there"]:
            return list(found["packages"])
    return None


# A PyBullet that is there stays: two packages of the same modules would overwrite each other's files.
if (there := installed_pybullet()) is not None:
    PYBULLET = there[:1]


class BuildWithCore(build_py):
    """Copies the package and its core, and nothing that an earlier build left."""

    def run(self) -> None:
        """Runs the command."""
        if not self.editable_mode:
            shutil.rmtree(Path(self.build_lib) / NAME, ignore_errors=True)
        super().run()
        library = core_build.build()
        if not self.editable_mode:
            shutil.copy2(library, Path(self.build_lib) / core_build.CORE)

    def get_outputs(self, include_bytecode: bool = True) -> list[str]:
        """All files that are copied, the core among them."""
        library = Path(self.build_lib) / core_build.CORE / core_build.LIBRARY
        return [*super().get_outputs(include_bytecode), *([str(library)] if library.is_file() else [])]


class DevelopWithCore(develop):
    """Builds the core where the sources are, as `colcon build --symlink-install` runs them."""

    def run(self) -> None:
        """Runs the command."""
        super().run()
        if not self.uninstall:
            core_build.build()


class InstallAnew(install_lib):
    """Installs in the place of what was there: a module of before would belong to other sources."""

    def run(self) -> None:
        """Runs the command."""
        package = Path(self.install_dir) / NAME
        if not package.is_symlink():
            shutil.rmtree(package, ignore_errors=True)
        super().run()


class WithCore(Distribution):
    """A wheel for the Python and the kind of processor that its core is for."""

    def has_ext_modules(self) -> bool:
        """Whether there is more than Python in it. Elsewhere setuptools would look for libraries of its own."""
        return IS_WHEEL


def files(folder: str, pattern: str) -> list[str]:
    """Files of a folder, as setuptools wants them: relative to this one."""
    return sorted(str(path) for path in Path(folder).glob(pattern) if path.is_file())


setup(
    name=NAME,
    version="0.2.0",
    distclass=WithCore,
    cmdclass={"build_py": BuildWithCore, "develop": DevelopWithCore, "install_lib": InstallAnew},
    options={"bdist_wheel": {"py_limited_api": "cp312"}} if core_build.STABLE_ABI else {},
    packages=find_packages(include=[NAME, f"{NAME}.*"]),
    package_data={NAME: ["py.typed", "tools/evaluation/scenes/*.yaml", "soil/soils.yaml", "scenes/*.urdf"]},
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{NAME}"]),
        (f"share/{NAME}", ["package.xml"]),
        (f"share/{NAME}/config", files("config", "*")),
        (f"share/{NAME}/launch", files("launch", "*.launch.py")),
        # On the path of a sourced workspace, whose console scripts are not; a wheel puts those there.
        *([] if IS_WHEEL or "editable_wheel" in sys.argv else [("bin", ["bin/smartmesh"])]),
    ],
    python_requires=">=3.11",
    install_requires=["numpy", *PYBULLET, "pyyaml"],
    extras_require={
        "bags": ["rosbags"],
        "files": ["pillow", "rasterio"],
        "test": ["hypothesis", "pytest"],
        "replay": ["rosbags"],
        "tune": ["matplotlib", "rosbags"],
        "view": ["viser[urdf]"],
    },
    zip_safe=False,
    maintainer="smartmesh_ros maintainers",
    maintainer_email="maintainers@smartmesh-ros.invalid",
    description="PyBullet bodies and robots stand on height maps that move.",
    long_description=(ROOT / "README.md").read_text(),
    long_description_content_type="text/markdown",
    license="Apache-2.0",
    entry_points={
        "console_scripts": [
            f"{command} = {NAME}.startup.executables:{function}"
            for command, function in (
                *((name, name) for name in (*COMMANDS, *(() if IS_WHEEL else FOR_ROS2_RUN))),
                *((f"smartmesh-{name.replace('_', '-')}", name) for name in PREFIXED),
            )
        ],
    },
)
