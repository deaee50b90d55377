"""Publish taxel arrays as tactile_msgs/TactileState, for RViz's tactile displays and ubi-agni's tactile_toolbox.

    python examples/tactile_state_bridge.py --ros-args -p pads:="[left, right]"

For each array, the node publishes a message with one sensor on `tactile_states`. The sensor has the name of the pad,
which must be the name of the channel in the URDF. The node keeps the stamp, and copies the values row by row in the
unit of the skin.

A taxel without a valid value is NaN, never 0. The displays in RViz paint NaN in an error colour. The program
tactile_merger averages NaN into its contact, so that the place of the contact becomes NaN and a running mean stays NaN
from then on. For programs like tactile_merger, set `nan:=leave_out`. The node then publishes a pad only while all of
the pad's taxels have values. Places without a taxel are NaN with either setting, because no taxel in the URDF has the
index of such a place.
"""

import sys

from sensor_msgs.msg import ChannelFloat32

from tactile_skin.msg import TaxelArray

KEEP = 'keep'            # setting of the parameter nan that publishes NaN
LEAVE_OUT = 'leave_out'  # setting of the parameter nan that skips arrays with NaN


def tactile_state(taxels: TaxelArray, name: str, nan: str = KEEP):
    """Return the TactileState for ``taxels``, or None if the array must not be published."""
    from tactile_msgs.msg import TactileState
    codes = (TaxelArray.VALID, TaxelArray.SATURATED, TaxelArray.UNMAPPED)
    if nan == LEAVE_OUT and not all(code in codes for code in taxels.status):
        return None
    return TactileState(header=taxels.header, sensors=[ChannelFloat32(name=name, values=taxels.values)])


def make_node(**options):
    """Return the node. Raises ImportError without tactile_msgs, and ValueError for an invalid parameter."""
    from functools import partial

    from rclpy.node import Node
    from rclpy.qos import QoSProfile
    from tactile_msgs.msg import TactileState

    from tactile_node.ros.message_checks import check_taxel_array

    def on_taxels(pad: str, taxels: TaxelArray) -> None:
        reason = check_taxel_array(taxels)  # malformed messages are dropped
        if reason is not None:
            node.get_logger().warning(f'{pad}: taxels dropped: {reason.key}', throttle_duration_sec=10.0)
            return
        state = tactile_state(taxels, pad, nan)
        if state is not None:
            publisher.publish(state)

    node = Node('tactile_state_bridge', **options)
    pads = node.declare_parameter('pads', ['left', 'right']).value
    nan = node.declare_parameter('nan', KEEP).value
    if nan not in (KEEP, LEAVE_OUT):
        node.destroy_node()
        raise ValueError(f'parameter nan: expected {KEEP} or {LEAVE_OUT}, got {nan!r}')
    publisher = node.create_publisher(TactileState, 'tactile_states', QoSProfile(depth=10))
    for pad in pads:
        node.create_subscription(TaxelArray, f'{pad}/taxels', partial(on_taxels, pad), QoSProfile(depth=10))
    return node


def main() -> int:
    import rclpy
    from rclpy.executors import ExternalShutdownException
    rclpy.init()
    try:
        rclpy.spin(make_node())
    except (KeyboardInterrupt, ExternalShutdownException):
        return 0
    except ImportError as error:
        if not str(error.name).startswith('tactile_msgs'):
            raise
        print('tactile_state_bridge: error: expected the package tactile_msgs, got none. Build a ROS 2 port of it '
              '(github.com/ubi-agni/tactile_toolbox, folder tactile_msgs) in your workspace and source it.',
              file=sys.stderr)
        return 2
    except ValueError as error:
        print(f'tactile_state_bridge: error: {error}', file=sys.stderr)
        return 2
    return 0


if __name__ == '__main__':
    sys.exit(main())
