"""One host runs another version of our messages.

The middleware connects both versions, and would read values from the wrong places.

The test builds the other version of the messages once, which takes 10 s. Because of this build, the test runs only with
TACTILE_LONG. See also test_malformed_messages.py.
"""

import os
import subprocess
import sys
from pathlib import Path

import pytest
from built_messages import built
from ros_bench import RosBench

from tactile_node.nodes.guarded_subscription import GuardedSubscription
from tactile_node.ros.message_checks import check_taxel_array
from tactile_node.ros.qos import frames_qos
from tactile_node.skin.taxel_array import RejectReason
from tactile_skin.msg import TaxelArray

pytestmark = [pytest.mark.ros, pytest.mark.bus,
              pytest.mark.skipif(not os.environ.get('TACTILE_LONG'), reason='TACTILE_LONG is not set')]

BUILD = Path(__file__).resolve().parents[1] / 'build' / 'messages'
PUBLISHER = '''
import time, rclpy
from tactile_skin.msg import TaxelArray
rclpy.init()
node = rclpy.create_node('old_driver')
publisher = node.create_publisher(TaxelArray, 'left/taxels', 10)
for sequence in range(200):
    message = TaxelArray(rows=2, cols=3, pitch=0.002, unit='Pa', values=[0.0] * 6, status=[1] * 6, sequence=sequence)
    message.header.stamp = node.get_clock().now().to_msg()
    publisher.publish(message)
    time.sleep(0.02)
'''


def old_publisher() -> subprocess.Popen:
    modules = built('tactile_skin', BUILD)
    environment = {**os.environ, 'PYTHONPATH': str(modules), '_ROS_WHEELS_BOOTSTRAP_COMPLETE': '1',
                   'LD_LIBRARY_PATH': f'{modules.parents[1]}:{os.environ.get("LD_LIBRARY_PATH", "")}'}
    return subprocess.Popen([sys.executable, '-c', PUBLISHER], env=environment)


def test_no_message_of_another_version_is_used(ros):
    """Without the version check, 2 rows of 3 taxels would silently be read as 3 rows of 2."""
    bench, received = RosBench(ros), []
    subscription = GuardedSubscription(bench.add('reader'), TaxelArray, 'left/taxels', received.append,
                                       frames_qos(10), check=check_taxel_array)
    publisher = old_publisher()
    ros.callback(publisher.wait)
    ros.callback(publisher.kill)
    # DDS may discover a publisher before the name of its node
    bench.until(lambda: subscription.counts.received >= 5 and subscription.health.other_types == ('/old_driver',))
    assert not received
    assert subscription.counts.dropped == {RejectReason.OTHER_TYPE: subscription.counts.received}
