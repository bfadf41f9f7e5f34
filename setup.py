"""Installs the ament_python package smartmesh_ros, with its C++ core and its machine code."""

import json
import os
import shutil
import subprocess
import sys
from functools import cache
from pathlib import Path

from setuptools import Distribution, find_packages, setup
from setuptools.command.build_py import build_py
from setuptools.command.develop import develop
from setuptools.command.install_lib import install_lib

NAME = "smartmesh_ros"
ROOT = Path(__file__).resolve().parent
sys.path.insert(0, str(ROOT))
import core_build  # noqa: E402
from smartmesh_ros.machine_code import FOLDER_NAME  # noqa: E402  # needs nothing but Python

# For `ros2 run`. A wheel puts its commands onto everybody's path, where `view` is vim's: there it is smartmesh-view.
IN_WORKSPACES = [
    f"fleet_front = {NAME}.startup.executables:fleet_front",
    f"rover = {NAME}.startup.executables:rover",
    f"soil = {NAME}.startup.executables:soil",
    f"tune = {NAME}.startup.executables:tune",
    f"view = {NAME}.startup.executables:view",
]
IS_WHEEL = bool({"bdist_wheel", "dist_info"} & {*sys.argv})
# Builds without the core and machine code: a wheel for all machines, whose nodes compile when they are first started.
PURE = os.environ.get("SMARTMESH_PURE") == "1"
# PyBullet has wheels for Linux up to Python 3.11. A fork of it has them for 3.12 and 3.13, and is imported by the same
# name. The markers are those of requirements/pybullet.txt.
PYBULLET = [
    'pybullet-arm64==3.2.8; platform_system == "Linux" and platform_machine == "x86_64"'
    ' and python_version >= "3.12" and python_version < "3.14"',
    'pybullet; platform_system != "Linux" or platform_machine != "x86_64"'
    ' or python_version < "3.12" or python_version >= "3.14"',
]
# Prints what compiling in advance lacks, and which packages a PyBullet is from that is there.
ASK = """
import json
from importlib.metadata import packages_distributions
from importlib.util import find_spec
missing = [name for name in ("pybullet", "numba", "numpy") if find_spec(name) is None]
names = [] if "pybullet" in missing else packages_distributions().get("pybullet", [])
print(json.dumps({"missing": missing, "pybullet": sorted(set(names))}))
"""


def environment() -> tuple[dict[str, str], list[str], list[str]]:
    """Return the variables of a Python that has PyBullet, what it lacks for compiling, and its packages named PyBullet.

    pip builds in an environment that holds the build's requirements alone, which two variables set up. Without them
    Python is that of the environment which the package is installed into.
    """
    outside = {name: value for name, value in os.environ.items() if name not in ("PYTHONPATH", "PYTHONNOUSERSITE")}
    for variables in ({**os.environ}, outside):
        found = json.loads(python(ASK, variables))
        if "pybullet" not in found["missing"]:
            break
    return variables, found["missing"], found["pybullet"]


def python(script: str, variables: dict[str, str]) -> str:
    """Run a script with these environment variables; return what it prints."""
    command = [sys.executable, "-c", script]
    return subprocess.run(command, env=variables, stdout=subprocess.PIPE, text=True, check=True).stdout.strip()


VARIABLES, MISSING, INSTALLED = environment()
# A PyBullet that is there stays: two packages of the same modules would overwrite each other's files. A wheel for all
# machines cannot know.
if not PURE and "pybullet" not in MISSING:
    PYBULLET = INSTALLED[:1]


def compile_beforehand() -> Path | None:
    """Compiles from the sources here, on all cores; returns the folder, or None and prints the reason."""
    if PURE:
        return None
    if MISSING:
        print(f"no machine code is built, because of missing packages ({', '.join(MISSING)}); the first start compiles")
        return None
    here = f"import sys; sys.path.insert(0, {str(ROOT)!r}); "
    compiling = [sys.executable, "-c", f"{here}from smartmesh_ros.compiling import main; main()"]
    if subprocess.run(compiling, env=VARIABLES, check=False).returncode:
        print("no machine code is built, for the reason above; the first start compiles")
    place = python(f"{here}from smartmesh_ros import machine_code; print(machine_code.complete() or '')", VARIABLES)
    return Path(place) if place else None


@cache
def core() -> Path:
    """Builds the core in place and returns the library. Ends the build if that fails."""
    library = ROOT / core_build.CORE / core_build.library_name()
    core_build.build(library)
    return library


class BuildCompiled(build_py):
    """Copies the package, its core and its machine code, and nothing that an earlier build left."""

    def run(self) -> None:
        """Runs the command."""
        if self.editable_mode:
            super().run()
            core()
            compile_beforehand()
            return
        package = Path(self.build_lib) / NAME
        shutil.rmtree(package, ignore_errors=True)
        super().run()
        shutil.copy2(core(), Path(self.build_lib) / core_build.CORE)
        if (made := compile_beforehand()) is not None:
            shutil.copytree(made, package / FOLDER_NAME / made.name)

    def get_outputs(self, include_bytecode: bool = True) -> list[str]:
        """All files that are copied, the core and the machine code among them."""
        made = (Path(self.build_lib) / NAME).glob(f"{FOLDER_NAME}/*/*")
        library = Path(self.build_lib) / core_build.CORE / core_build.library_name()
        return [*super().get_outputs(include_bytecode), *(str(path) for path in (library, *made) if path.is_file())]


class DevelopCompiled(develop):
    """Compiles for the sources where they are, as `colcon build --symlink-install` runs them."""

    def run(self) -> None:
        """Runs the command."""
        super().run()
        if not self.uninstall:
            core()
            compile_beforehand()


class InstallAnew(install_lib):
    """Installs in the place of what was there: a module or machine code of before would belong to other sources."""

    def run(self) -> None:
        """Runs the command."""
        package = Path(self.install_dir) / NAME
        if not package.is_symlink():
            shutil.rmtree(package, ignore_errors=True)
        super().run()


class Compiled(Distribution):
    """A wheel for the Python and the kind of processor that its core and its machine code are for."""

    def has_ext_modules(self) -> bool:
        """Whether there is more than Python in it."""
        return IS_WHEEL and not PURE and (not MISSING or core() is not None)


def files(folder: str, pattern: str) -> list[str]:
    """Files of a folder, as setuptools wants them: relative to this one."""
    return sorted(str(path) for path in Path(folder).glob(pattern) if path.is_file())


setup(
    name=NAME,
    version="0.1.0",
    distclass=Compiled,
    cmdclass={"build_py": BuildCompiled, "develop": DevelopCompiled, "install_lib": InstallAnew},
    # Unlike machine code, the core alone is for later versions of Python as well.
    options={"bdist_wheel": {"py_limited_api": "cp312"}} if core_build.STABLE_ABI and MISSING else {},
    packages=find_packages(include=[NAME, f"{NAME}.*"]),
    package_data={NAME: ["py.typed", "evaluation/scenes/*.yaml", "soil/soils.yaml"]},
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{NAME}"]),
        (f"share/{NAME}", ["package.xml"]),
        (f"share/{NAME}/config", files("config", "*")),
        (f"share/{NAME}/launch", files("launch", "*.launch.py")),
    ],
    python_requires=">=3.10",
    install_requires=["numba", "numpy", *PYBULLET],
    extras_require={
        "bags": ["rosbags"],
        "files": ["pillow", "rasterio"],
        "test": ["hypothesis", "pytest"],
        "tune": ["matplotlib", "optuna", "rosbags"],
        "view": ["viser[urdf]"],
    },
    zip_safe=False,
    maintainer="smartmesh_ros maintainers",
    maintainer_email="maintainers@smartmesh-ros.invalid",
    description="Collide with terrain that moves: small, velocity-carrying collider patches that follow bodies.",
    long_description=(ROOT / "README.md").read_text(),
    long_description_content_type="text/markdown",
    license="Apache-2.0",
    entry_points={
        "console_scripts": [
            f"terrain_collider = {NAME}.startup.executables:terrain_collider",
            f"smartmesh-fleet = {NAME}.startup.executables:fleet",
            f"terrain_sensor = {NAME}.startup.executables:terrain_sensor",
            f"terrain_source = {NAME}.startup.executables:terrain_source",
            f"smartmesh-compile = {NAME}.startup.executables:compile_ahead",
            f"smartmesh-demo = {NAME}.startup.executables:demo",
            f"smartmesh-fleet-front = {NAME}.startup.executables:fleet_front",
            f"smartmesh-rover = {NAME}.startup.executables:rover",
            f"smartmesh-soil = {NAME}.startup.executables:soil",
            f"smartmesh-tune = {NAME}.startup.executables:tune",
            f"smartmesh-view = {NAME}.startup.executables:view",
            *([] if IS_WHEEL else IN_WORKSPACES),
        ],
    },
)
