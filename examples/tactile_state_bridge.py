"""Publish taxel arrays as tactile_msgs/TactileState, for RViz's tactile displays and ubi-agni's tactile_toolbox.

    python examples/tactile_state_bridge.py --ros-args -p pads:="[left, right]"

For each array, the node publishes one message on `tactile_states`, with one sensor. The name of the sensor is the name
of the pad, and must be the channel in the URDF. Stamp and values are unchanged, row by row, in the unit of the skin.

A taxel without a valid value is NaN, never 0. The displays of RViz paint NaN in an error colour. tactile_merger
averages NaN into its contact, so the place of the contact becomes NaN, and a running mean stays NaN once it has
received one. For such programs, use `nan:=leave_out`: a pad is then not published while any of its taxels has no value.
Places without a taxel are NaN in both cases, because no taxel in the URDF has their index.
"""

import sys

from sensor_msgs.msg import ChannelFloat32

from tactile_skin.msg import TaxelArray

KEEP = 'keep'            # value of the parameter nan
LEAVE_OUT = 'leave_out'  # value of the parameter nan


def tactile_state(taxels: TaxelArray, name: str, nan: str = KEEP):
    """Return the TactileState for ``taxels``, or None if it must be left out."""
    from tactile_msgs.msg import TactileState
    codes = (TaxelArray.VALID, TaxelArray.SATURATED, TaxelArray.UNMAPPED)
    if nan == LEAVE_OUT and not all(code in codes for code in taxels.status):
        return None
    return TactileState(header=taxels.header, sensors=[ChannelFloat32(name=name, values=taxels.values)])


def make_node(**options):
    """Return the node. Raises ImportError without tactile_msgs, ValueError for a wrong parameter."""
    from functools import partial

    from rclpy.node import Node
    from rclpy.qos import QoSProfile
    from tactile_msgs.msg import TactileState

    from tactile_node.ros.message_checks import check_taxel_array

    def on_taxels(pad: str, taxels: TaxelArray) -> None:
        reason = check_taxel_array(taxels)  # a malformed message is ignored
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
