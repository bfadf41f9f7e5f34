from setuptools import setup

setup(
    name="my_robot",
    version="0.0.0",
    packages=["my_robot"],
    data_files=[
        ("share/ament_index/resource_index/packages", ["resource/my_robot"]),
        ("share/my_robot", ["package.xml"]),
    ],
    entry_points={"console_scripts": ["first_steps = my_robot.first_steps:main", "idle = my_robot.idle:main"]},
)
