"""Names and types of all topics that carry one message per frame."""

from collections.abc import Sequence

#: Types of the topics by name relative to the pad, without `pose` and `shapes`.
PAD_TOPICS = {'taxels': 'tactile_skin/msg/TaxelArray', 'contact': 'tactile_skin/msg/Contact',
              'features': 'tactile_skin/msg/ContactFeatures', 'shape': 'tactile_skin/msg/ContactShape',
              'image': 'sensor_msgs/msg/Image', 'image_colour': 'sensor_msgs/msg/Image',
              'markers': 'visualization_msgs/msg/MarkerArray', 'wrench': 'geometry_msgs/msg/WrenchStamped'}


def frame_topics(pads: Sequence[str], namespace: str = '') -> dict[str, str]:
    """Return the full topic names and their types, with the grasp topic only for two pads."""
    root = f'/{namespace.strip("/")}'.rstrip('/')
    grasp = {f'{root}/grasp': 'tactile_skin/msg/Grasp'} if len(pads) == 2 else {}
    return {f'{root}/{pad}/{name}': kind for pad in pads for name, kind in PAD_TOPICS.items()} | grasp
