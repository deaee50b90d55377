"""The topics of one bus that come frame by frame, with their types."""

from collections.abc import Sequence

#: by name relative to the pad; `pose` and `shapes` come too
PAD_TOPICS = {'taxels': 'tactile_skin/msg/TaxelArray', 'contact': 'tactile_skin/msg/Contact',
              'features': 'tactile_skin/msg/ContactFeatures', 'shape': 'tactile_skin/msg/ContactShape',
              'image': 'sensor_msgs/msg/Image', 'image_colour': 'sensor_msgs/msg/Image',
              'markers': 'visualization_msgs/msg/MarkerArray', 'wrench': 'geometry_msgs/msg/WrenchStamped'}


def frame_topics(pads: Sequence[str], namespace: str = '') -> dict[str, str]:
    """Return full names and types; two pads have a grasp."""
    root = f'/{namespace.strip("/")}'.rstrip('/')
    grasp = {f'{root}/grasp': 'tactile_skin/msg/Grasp'} if len(pads) == 2 else {}
    return {f'{root}/{pad}/{name}': kind for pad in pads for name, kind in PAD_TOPICS.items()} | grasp
