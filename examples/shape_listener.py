"""Print the shape that touches a pad, in the smallest program that uses the topic `<pad>/shape`.

    python examples/shape_listener.py --ros-args -r shape:=/pad/shape
"""

import rclpy
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node

from tactile_node.code_names import name_of
from tactile_skin.msg import ContactShape


class ShapeListener(Node):
    """Prints a line whenever the shape or the reason for UNKNOWN changes."""

    def __init__(self):
        super().__init__('shape_listener')
        self._last = None
        self.create_subscription(ContactShape, 'shape', self._on_shape, 1)  # a depth of 1 keeps only the latest shape

    def _on_shape(self, message: ContactShape) -> None:
        if (message.shape, message.unknown_reason) == self._last:
            return
        self._last = message.shape, message.unknown_reason
        print(text_of(message), flush=True)


def text_of(message: ContactShape) -> str:
    """Return the shape and its confidence, with the reason for UNKNOWN, or the size if the fit is valid."""
    details = ', '.join(f'{name} {">= " if is_bound else ""}{1000 * length:.1f} mm' for name, length, is_bound in zip(
        message.dimension_names, message.dimensions, message.dimension_is_bound)) if message.fit_valid else ''
    if message.shape == ContactShape.UNKNOWN:
        details = name_of(ContactShape, 'unknown_reason', message.unknown_reason).lower().replace('_', ' ')
    return f'{message.class_name:20}{100 * message.confidence:4.0f} %  {details}'


def main() -> None:
    rclpy.init()
    try:
        rclpy.spin(ShapeListener())
    except (KeyboardInterrupt, ExternalShutdownException):
        pass
    finally:
        rclpy.try_shutdown()


if __name__ == '__main__':
    main()
