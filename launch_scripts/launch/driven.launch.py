"""Starts a scenario whose modules are moved by drivers, and the example driver that plays their robots.

    ros2 launch formation_launch driven.launch.py scenario:=mcs_detach
"""

import os

from ament_index_python.packages import get_package_share_directory
from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, IncludeLaunchDescription, OpaqueFunction
from launch.launch_description_sources import PythonLaunchDescriptionSource
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node

PACKAGE = "formation_launch"


def launch_setup(context):
    share = get_package_share_directory(PACKAGE)
    name = LaunchConfiguration("scenario").perform(context)
    record = LaunchConfiguration("record").perform(context)
    path = name if os.path.isfile(name) else os.path.join(share, "scenarios", f"{name}.yaml")
    formation = PythonLaunchDescriptionSource(os.path.join(share, "launch", "formation.launch.py"))
    # The examples are installed next to the programs.
    driver = Node(package=PACKAGE, executable="drive_modules.py", arguments=["--scenario", path], output="screen")
    return [
        IncludeLaunchDescription(formation, launch_arguments={"scenario": path, "motion": "external", "record": record}.items()),
        driver,
    ]


def generate_launch_description():
    scenario = DeclareLaunchArgument(
        "scenario", default_value="mcs_detach", description="name of a scenario of the package, or the path of a file"
    )
    record = DeclareLaunchArgument(
        "record", default_value="", description="file (MCAP) into which all topics are recorded; empty for none"
    )
    return LaunchDescription([scenario, record, OpaqueFunction(function=launch_setup)])
