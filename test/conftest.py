"""For every test: ROS stays on this machine, each run of pytest in its own domain."""

import os
from pathlib import Path

import pytest

os.environ['ROS_AUTOMATIC_DISCOVERY_RANGE'] = 'LOCALHOST'
os.environ['ROS_DOMAIN_ID'] = str(1 + os.getpid() % 100)


@pytest.fixture(scope='session')
def tf_message():
    """The message of /tf."""
    from built_tf2_msgs import tf2_msgs
    with tf2_msgs(Path(__file__).resolve().parents[1] / 'build' / 'tf2_msgs'):
        from tf2_msgs.msg import TFMessage
        yield TFMessage
