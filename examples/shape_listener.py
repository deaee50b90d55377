"""Print the shape that touches a pad, in the smallest program that uses the topic `<pad>/shape`.

    python examples/shape_listener.py --ros-args -r shape:=/pad/shape
"""

import rclpy
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node

from tactile_skin.msg import ContactShape


class ShapeListener(Node):
    """Prints a line whenever the shape changes, with the size if the fit is valid."""

    def __init__(self):
        super().__init__('shape_listener')
        self._last = None
        self.create_subscription(ContactShape, 'shape', self._on_shape, 1)  # a depth of 1 keeps only the latest shape

    def _on_shape(self, message: ContactShape) -> None:
        if message.shape == self._last:
            return
        self._last = message.shape
        size = ', '.join(f'{name} {">= " if is_bound else ""}{1000 * length:.1f} mm' for name, length, is_bound in zip(
            message.dimension_names, message.dimensions, message.dimension_is_bound))
        print(f'{message.class_name:20}{100 * message.confidence:4.0f} %  {size if message.fit_valid else ""}',
              flush=True)


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
