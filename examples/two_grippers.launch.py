"""Start two grippers with two pads each: `ros2 launch /path/to/two_grippers.launch.py simulate:=true`."""

from launch.actions import DeclareLaunchArgument, GroupAction, IncludeLaunchDescription
from launch.launch_description_sources import PythonLaunchDescriptionSource
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import PushRosNamespace
from launch_ros.substitutions import FindPackageShare

from launch import LaunchDescription


def generate_launch_description() -> LaunchDescription:
    return LaunchDescription([DeclareLaunchArgument('simulate', default_value='false'),
                              gripper('left_arm', channel='can0'), gripper('right_arm', channel='can1')])


def gripper(arm: str, channel: str) -> GroupAction:
    """Start a gripper in its own group, which isolates the arguments, with topics such as /<arm>/gripper/left/shape."""
    bringup = PythonLaunchDescriptionSource([FindPackageShare('tactile_skin'), '/launch/bringup.launch.py'])
    given = {'channel': channel, 'pads': 'left,right', 'node_ids': '32,64', 'namespace': 'gripper',
             'frame_prefix': f'{arm}/', 'simulate': LaunchConfiguration('simulate')}
    return GroupAction([PushRosNamespace(arm), IncludeLaunchDescription(bringup, launch_arguments=given.items())])
