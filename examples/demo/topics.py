"""Topics of one bus with one message per frame, and their types."""

from collections.abc import Sequence

#: topic name relative to the pad -> type; `pose` and `shapes` are left out
PAD_TOPICS = {'taxels': 'tactile_skin/msg/TaxelArray', 'contact': 'tactile_skin/msg/Contact',
              'features': 'tactile_skin/msg/ContactFeatures', 'shape': 'tactile_skin/msg/ContactShape',
              'image': 'sensor_msgs/msg/Image', 'image_colour': 'sensor_msgs/msg/Image',
              'markers': 'visualization_msgs/msg/MarkerArray', 'wrench': 'geometry_msgs/msg/WrenchStamped'}


def frame_topics(pads: Sequence[str], namespace: str = '') -> dict[str, str]:
    """Return the full topic names and their types; only two pads have a grasp."""
    root = f'/{namespace.strip("/")}'.rstrip('/')
    grasp = {f'{root}/grasp': 'tactile_skin/msg/Grasp'} if len(pads) == 2 else {}
    return {f'{root}/{pad}/{name}': kind for pad in pads for name, kind in PAD_TOPICS.items()} | grasp
