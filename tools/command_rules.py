"""Rules that classify each command in the documents, by its requirements or by the test that runs it.

The script documented_commands.py applies these rules.
"""

from enum import Enum
from typing import NamedTuple

#: Lines that begin with one of these words are commands.
PROGRAMS = ('tactile', 'make', 'python', 'python3', 'pip', 'ros2', 'rosdep', 'rviz2', 'sudo', 'ip', 'source', 'export',
            'kill', 'git', 'apt', 'plotjuggler', 'echo', 'fast-discovery-server', '.venv/bin/pre-commit',
            '.venv/bin/python')
HERE = 'test/test_documented_commands.py'  #: Test that runs all commands of class RUN, page by page and in order.


class CommandKind(Enum):
    RUN = 'run'
    TESTED = 'run by another test'
    CHECKED = 'in a sentence; everything that it names exists'
    HARDWARE = 'needs hardware'
    ROS2 = 'needs a ROS 2 installation'
    NETWORK = 'needs a network or root'
    MINUTES = 'takes minutes'
    SHELL = 'for an interactive shell'


class Rule(NamedTuple):
    pattern: str
    kind: CommandKind
    where: str = ''  #: path of the test that runs the command, or a remark


#: The first rule whose pattern matches a command decides.
RULES = (
    Rule(r'^(ros2|rosdep|rviz2|plotjuggler)\b', CommandKind.ROS2),
    Rule(r'^(for|done|do)\b|^(ros2|ROS_DOMAIN_ID=\S+ ros2) security', CommandKind.ROS2, 'SROS 2'),
    Rule(r'--enclave', CommandKind.ROS2, 'SROS 2'),
    Rule(r'^(export|source|kill|echo|register-python-argcomplete)\b', CommandKind.SHELL),
    Rule(r'^(sudo ip|ip)\b|socketcan', CommandKind.HARDWARE, 'a CAN interface of the kernel'),
    Rule(r'^(sudo apt|apt|git)\b', CommandKind.NETWORK),
    Rule(r'^sudo (ptp4l|phc2sys)\b', CommandKind.NETWORK, 'a network card with a PTP clock'),
    Rule(r'^pip install', CommandKind.NETWORK, 'test/test_installed.py installs the wheel'),
    Rule(r'pre-commit install', CommandKind.NETWORK, 'only writes a git hook'),
    Rule(r'^make (setup|demo|docs|test|check|lint|commands)\b', CommandKind.MINUTES, '.ci/run runs make test'),
    Rule(r'^make [\w-]+', CommandKind.MINUTES, 'by hand, before a release'),
    Rule(r'^python bench/', CommandKind.MINUTES, 'make bench'),
    Rule(r'^python -m training', CommandKind.MINUTES, 'make train'),
    Rule(r'^python examples/shape_listener.py', CommandKind.TESTED, 'test/test_tutorial.py'),
    Rule(r'^python examples/grasp_listener.py', CommandKind.TESTED, 'test/test_tutorial.py'),
    Rule(r'^python examples/other_skin.py', CommandKind.TESTED, 'test/test_other_skin.py'),
    Rule(r'^python3? examples/planner_client.py', CommandKind.TESTED, 'test/test_planner_client.py'),
    Rule(r'^python examples/lerobot_dataset.py', CommandKind.NETWORK, 'LeRobot; by hand'),
    Rule(r'^(python examples/rerun_bag.py|rerun)\b', CommandKind.NETWORK, 'Rerun; by hand'),
    Rule(r'^python test/misled_catalogue.py', CommandKind.MINUTES, 'make misled'),
    Rule(r'^python -m examples.simulated_gripper', CommandKind.MINUTES, 'by hand, because it needs MuJoCo'),
    Rule(r'^python -m tactile_node.gripper.gripper_node', CommandKind.TESTED, 'test/test_gripper_duplicates.py'),
    Rule(r'^tactile calibrate', CommandKind.TESTED, 'test/test_calibration.py'),
    Rule(r'^tactile bringup.*--interface slcan', CommandKind.TESTED, 'test/test_tutorial.py'),
    Rule(r'^tactile bringup', CommandKind.TESTED, 'test/test_bringup.py'),
    Rule(r'^tactile tare', CommandKind.TESTED, 'test/test_driver_recovery.py'),
    Rule(r'^tactile commission', CommandKind.TESTED, 'test/test_commission_command.py'),
    Rule(r'^tactile record', CommandKind.TESTED, 'test/test_can_commands.py'),
    Rule(r'^python -m can.logconvert', CommandKind.TESTED, 'test/test_logs.py'),
    Rule(r'^tactile report', CommandKind.TESTED, 'test/test_report_page.py'),
    Rule(r'^tactile teach', CommandKind.TESTED, 'test/test_teach.py'),
    Rule(r'^tactile assess', CommandKind.TESTED, 'test/test_assess.py'),
    Rule(r'^tactile view', CommandKind.TESTED, 'test/test_view_sources.py'),
    Rule(r'^fast-discovery-server -i', CommandKind.TESTED, 'test/hosts_bench.py'),
    Rule(r'^tactile sdo (?!.*slcan)', CommandKind.TESTED, 'test/test_sdo_command.py'),
    Rule(r'^tactile (replay|features|classify|draft|check|scan|simulate|sdo)\b', CommandKind.RUN, HERE),
)
