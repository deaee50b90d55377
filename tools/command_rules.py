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


class Kind(Enum):
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
    kind: Kind
    where: str = ''  #: path of the test that runs the command, or a remark


#: The first rule whose pattern matches a command decides.
RULES = (
    Rule(r'^(ros2|rosdep|rviz2|plotjuggler)\b', Kind.ROS2),
    Rule(r'^(for|done|do)\b|^(ros2|ROS_DOMAIN_ID=\S+ ros2) security', Kind.ROS2, 'SROS 2'),
    Rule(r'--enclave', Kind.ROS2, 'SROS 2'),
    Rule(r'^(export|source|kill|echo|register-python-argcomplete)\b', Kind.SHELL),
    Rule(r'^(sudo ip|ip)\b|socketcan', Kind.HARDWARE, 'a CAN interface of the kernel'),
    Rule(r'^(sudo apt|apt|git)\b', Kind.NETWORK),
    Rule(r'^sudo (ptp4l|phc2sys)\b', Kind.NETWORK, 'a network card with a PTP clock'),
    Rule(r'^pip install', Kind.NETWORK, 'test/test_installed.py installs the wheel'),
    Rule(r'pre-commit install', Kind.NETWORK, 'only writes a git hook'),
    Rule(r'^make (setup|demo|docs|test|check|lint|commands)\b', Kind.MINUTES, '.ci/run runs make test'),
    Rule(r'^make [\w-]+', Kind.MINUTES, 'by hand, before a release'),
    Rule(r'^python test/misled_catalogue.py', Kind.MINUTES, 'make misled'),
    Rule(r'^python bench/', Kind.MINUTES, 'make bench'),
    Rule(r'^python -m training', Kind.MINUTES, 'make train'),
    Rule(r'^python examples/shape_listener.py', Kind.TESTED, 'test/test_tutorial.py'),
    Rule(r'^python examples/grasp_listener.py', Kind.TESTED, 'test/test_tutorial.py'),
    Rule(r'^python examples/other_skin.py', Kind.TESTED, 'test/test_other_skin.py'),
    Rule(r'^python3? examples/planner_client.py', Kind.TESTED, 'test/test_planner_client.py'),
    Rule(r'^python examples/lerobot_dataset.py', Kind.NETWORK, 'LeRobot; by hand'),
    Rule(r'^(python examples/rerun_bag.py|rerun)\b', Kind.NETWORK, 'Rerun; by hand'),
    Rule(r'^python -m examples.simulated_gripper', Kind.MINUTES, 'by hand, because it needs MuJoCo'),
    Rule(r'^python -m tactile_node.gripper.gripper_node', Kind.TESTED, 'test/test_gripper_duplicates.py'),
    Rule(r'^tactile calibrate', Kind.TESTED, 'test/test_calibration.py'),
    Rule(r'^tactile bringup.*--interface slcan', Kind.TESTED, 'test/test_tutorial.py'),
    Rule(r'^tactile bringup', Kind.TESTED, 'test/test_bringup.py'),
    Rule(r'^tactile tare', Kind.TESTED, 'test/test_driver_recovery.py'),
    Rule(r'^tactile commission', Kind.TESTED, 'test/test_commission_command.py'),
    Rule(r'^tactile record', Kind.TESTED, 'test/test_can_commands.py'),
    Rule(r'^python -m can.logconvert', Kind.TESTED, 'test/test_logs.py'),
    Rule(r'^tactile report', Kind.TESTED, 'test/test_report_page.py'),
    Rule(r'^tactile teach', Kind.TESTED, 'test/test_teach.py'),
    Rule(r'^tactile assess', Kind.TESTED, 'test/test_assess.py'),
    Rule(r'^tactile view', Kind.TESTED, 'test/test_view_sources.py'),
    Rule(r'^fast-discovery-server -i', Kind.TESTED, 'test/hosts_bench.py'),
    Rule(r'^tactile sdo (?!.*slcan)', Kind.TESTED, 'test/test_sdo_command.py'),
    Rule(r'^tactile (replay|features|classify|draft|check|scan|simulate|sdo)\b', Kind.RUN, HERE),
)
