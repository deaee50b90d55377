"""Publish data from a skin without CANopen as TaxelArray messages, so that all nodes after the driver can use the skin.

    python examples/other_skin.py --ros-args -r __ns:=/left -p source:=array -p rows:=12 -p cols:=8 -p pitch:=0.004
    tactile bringup --side perception --pads left

Sources on the topic `raw` are `array` (Float32MultiArray), `image` (Image, 32FC1), `robotiq` (robotiq_tsf/StaticData)
and `xela` (xela_server_ros2/SensStream). The source `serial` reads one line of numbers per frame from a serial port. Do
not touch the skin until the node has measured the zero of each taxel.
"""

import sys
from collections.abc import Callable, Mapping
from importlib import import_module
from types import MappingProxyType
from typing import Any

import numpy as np
import rclpy
from builtin_interfaces.msg import Duration
from rclpy.exceptions import ParameterException
from rclpy.node import Node
from rclpy.qos import qos_profile_sensor_data

from tactile_node.errors import ConfigurationError, DeviceError, TactileError
from tactile_skin.msg import TaxelArray

ZERO_FRAMES = 20  #: number of frames averaged to measure the zero

#: For each source, the package, the message and a function that returns the numbers of a pad. The numbers may be in any
#: order that matches `rows` and `cols`.
SOURCES: Mapping[str, tuple[str, str, Callable[[Any, int], Any]]] = MappingProxyType({
    'array': ('std_msgs', 'Float32MultiArray', lambda message, pad: message.data),
    'image': ('sensor_msgs', 'Image', lambda message, pad: pixels(message)),
    'robotiq': ('robotiq_tsf', 'StaticData', lambda message, pad: message.taxels[pad].values),
    # The list of sensors has no gaps for missing sensors. Only sensor_pos, counted from 1, identifies a sensor. The
    # shear in x and y is dropped, because TaxelArray has no field for it.
    'xela': ('xela_server_ros2', 'SensStream', lambda message, pad: [
        each.z for sensor in message.sensors if sensor.sensor_pos == pad + 1 for each in sensor.forces])})
PARAMETERS = {'source': 'array', 'pad': 0, 'rows': 12, 'cols': 8, 'pitch': 0.004, 'unit': 'Pa', 'scale': 1.0,
              'flip': False, 'frame': 'pad', 'port': '/dev/ttyACM0', 'baud_rate': 115200}


def pixels(image: Any) -> np.ndarray:
    """Return the pixels of a 32FC1 image as (height, width), or an empty array for any other encoding."""
    if image.encoding != '32FC1':
        return np.empty(0)
    return np.ndarray((image.height, image.width), '>f4' if image.is_bigendian else '<f4', bytes(image.data),
                      strides=(image.step, 4))


class OtherSkin(Node):
    """One pad.

    The parameter ``scale`` converts the source's numbers to ``unit``. Use a negative ``scale`` if pressing lowers the
    numbers.
    """

    def __init__(self, **options: Any) -> None:
        super().__init__('other_skin', **options)
        self.settings = {name: self.declare_parameter(name, value).value for name, value in PARAMETERS.items()}
        self._first: list[np.ndarray] = []
        self._sequence = 0
        self._publisher = self.create_publisher(TaxelArray, 'taxels', 10)
        source = self.settings['source']
        if source not in (*SOURCES, 'serial'):
            raise ConfigurationError('parameter source', expected=f'one of {", ".join(SOURCES)}, serial',
                                     got=repr(source), remedy='Set source to one of these values.')
        if source != 'serial':
            package, name, self._numbers = SOURCES[source]
            self.create_subscription(_message_type(package, name), 'raw', self._on_message, qos_profile_sensor_data)

    def _on_message(self, message: Any) -> None:
        self.take(self._numbers(message, self.settings['pad']))

    def take(self, numbers: Any) -> None:
        """Publish a frame, in which NaN means that a taxel has no value."""
        now, rows, cols = self.get_clock().now(), self.settings['rows'], self.settings['cols']
        self._sequence += 1  # count unusable frames too, so that receivers count the gap as a loss
        raw = np.asarray(numbers, float)
        if raw.shape not in ((rows * cols,), (rows, cols)):
            self.get_logger().error(f'frame dropped: expected {rows} * {cols} numbers, got {raw.shape}',
                                    throttle_duration_sec=1.0)
            return
        raw = raw.reshape(rows, cols)[::-1 if self.settings['flip'] else 1]
        if len(self._first) < ZERO_FRAMES:
            self._first.append(raw)
            self._zero = np.ma.masked_invalid(self._first).mean(0).filled(np.nan)
            return
        values = ((raw - self._zero) * self.settings['scale']).astype(np.float32).ravel()
        values[~np.isfinite(values)] = np.nan
        message = TaxelArray(sequence=self._sequence, rows=rows, cols=cols, pitch=self.settings['pitch'],
                             unit=self.settings['unit'], values=values, age=Duration(),
                             status=np.where(np.isnan(values), TaxelArray.STALE, TaxelArray.VALID).astype(np.uint8))
        message.header.stamp, message.header.frame_id = now.to_msg(), self.settings['frame']
        self._publisher.publish(message)

    def read_serial(self) -> None:
        """Read lines of numbers that are separated by blanks or commas, until the node ends. Raises a TactileError."""
        try:
            from serial import Serial
        except ModuleNotFoundError:
            raise ConfigurationError('parameter source', expected='the Python module serial', got='none',
                                     remedy='Install the module: pip install pyserial.') from None
        name = self.settings['port']
        try:
            port = Serial(name, self.settings['baud_rate'], timeout=1.0)
        except (OSError, ValueError) as error:
            raise ConfigurationError('parameter port', expected='a serial port that opens', got=f'{name}: {error}',
                                     remedy='Check port and baud_rate, and join the group dialout.') from None
        with port:
            while rclpy.ok():
                try:
                    words = port.readline().replace(b',', b' ').split()
                except OSError as error:
                    raise DeviceError(f'serial port {name}', expected='to receive', got=str(error),
                                      remedy='Check the cable, and restart this node.') from None
                if words:
                    self.take([_number(word) for word in words])


def _message_type(package: str, name: str) -> Any:
    try:
        return getattr(import_module(f'{package}.msg'), name)
    except ModuleNotFoundError:
        raise ConfigurationError('parameter source', expected=f'the messages of {package}', got='no such package',
                                 remedy='Source the workspace that contains this package.') from None


def _number(word: bytes) -> float:
    try:
        return float(word)
    except ValueError:
        return np.nan


def main() -> int:
    """Publish until Ctrl-C, and return 2 if a parameter or the device cannot be used."""
    try:
        rclpy.init()
        node = OtherSkin()
        node.read_serial() if node.settings['source'] == 'serial' else rclpy.spin(node)
    except (KeyboardInterrupt, rclpy.executors.ExternalShutdownException):
        pass
    except (TactileError, ParameterException) as error:
        print(f'other_skin: error: {error}', file=sys.stderr)
        return 2
    finally:
        rclpy.try_shutdown()
    return 0


if __name__ == '__main__':
    sys.exit(main())
