"""Start MoveIt for the Panda arm of moveit_resources, with two tactile pads and touch_gripper as its gripper.

    ros2 launch examples/moveit/panda.launch.py channel:=can0

The arm is the mock hardware of ros2_control. docs/howto/moveit.md describes what was tested.
"""

import sys
from pathlib import Path

from launch.actions import DeclareLaunchArgument, ExecuteProcess, IncludeLaunchDescription
from launch.launch_description_sources import PythonLaunchDescriptionSource
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node
from launch_ros.substitutions import FindPackageShare
from moveit_configs_utils import MoveItConfigsBuilder

from launch import LaunchDescription

HERE = Path(__file__).resolve().parent
CONTROLLERS = ('joint_state_broadcaster', 'panda_arm_controller', 'panda_hand_controller')


def generate_launch_description() -> LaunchDescription:
    return LaunchDescription([DeclareLaunchArgument('channel', default_value='can0'),
                              DeclareLaunchArgument('simulate', default_value='false'), *arm(), *skin()])


def arm() -> list[Node]:
    """Return the nodes of MoveIt and of the mock hardware."""
    moveit = MoveItConfigsBuilder('moveit_resources_panda').robot_description(
        file_path='config/panda.urdf.xacro').robot_description_semantic(
        file_path='config/panda.srdf').planning_scene_monitor(
        publish_robot_description=True, publish_robot_description_semantic=True).trajectory_execution(
        file_path=str(HERE / 'controllers.yaml')).to_moveit_configs()
    hardware = [FindPackageShare('moveit_resources_panda_moveit_config'), '/config/ros2_controllers.yaml']
    return [Node(package='moveit_ros_move_group', executable='move_group', parameters=[moveit.to_dict()]),
            Node(package='robot_state_publisher', executable='robot_state_publisher',
                 parameters=[moveit.robot_description]),
            Node(package='tf2_ros', executable='static_transform_publisher',
                 arguments=['--frame-id', 'world', '--child-frame-id', 'panda_link0']),
            Node(package='controller_manager', executable='ros2_control_node', parameters=[hardware],
                 remappings=[('/controller_manager/robot_description', '/robot_description')]),
            *(Node(package='controller_manager', executable='spawner', arguments=[each]) for each in CONTROLLERS)]


def skin() -> list[IncludeLaunchDescription | ExecuteProcess]:
    """Return the driver, the perception, touch_gripper and the node that attaches the held object."""
    bringup = PythonLaunchDescriptionSource([FindPackageShare('tactile_skin'), '/launch/bringup.launch.py'])
    given = {'channel': LaunchConfiguration('channel'), 'simulate': LaunchConfiguration('simulate'),
             'pads': 'left,right', 'node_ids': '32,64', 'params_file': str(HERE / 'panda.yaml'),
             'gripper_action': 'panda_hand_controller/gripper_cmd'}
    return [IncludeLaunchDescription(bringup, launch_arguments=given.items()),
            ExecuteProcess(cmd=[sys.executable, str(HERE.parent / 'attached_object.py')], output='screen')]
