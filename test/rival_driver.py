"""Driver for another bus with the same node names. This driver reports both pads as seen and empty.

    python test/rival_driver.py PERIOD

Like a second robot on the same network, this driver shares only the message type with the package.
"""

import sys
import time

import rclpy
from builtin_interfaces.msg import Duration

from tactile_skin.msg import TaxelArray

SIDE = 16  #: Number of rows, and of columns, in a pad.


def main() -> None:
    period = float(sys.argv[1])
    rclpy.init(args=[])
    node = rclpy.create_node('other_robots_driver')
    pads = {pad: node.create_publisher(TaxelArray, f'{pad}/taxels', 10) for pad in ('left', 'right')}
    print('ready', flush=True)
    for sequence in range(10**6):
        for pad, publisher in pads.items():
            publisher.publish(empty(node, pad, sequence))
        time.sleep(period)


def empty(node, pad: str, sequence: int) -> TaxelArray:
    message = TaxelArray(rows=SIDE, cols=SIDE, pitch=0.002, unit='Pa', sequence=sequence,
                         values=[0.0] * SIDE**2, status=[TaxelArray.VALID] * SIDE**2, age=Duration(nanosec=1_000_000))
    message.header.stamp, message.header.frame_id = node.get_clock().now().to_msg(), f'{pad}_pad'
    return message


if __name__ == '__main__':
    main()
