"""Taxel arrays as images: a pixel a taxel.

Row 0 of the image is row 0 of the pad. A viewer draws it at the top, so that y of the pad runs down and z points away:
the picture is that of the pad from behind, as from inside the finger.
"""

import sys
from array import array

import numpy as np
from sensor_msgs.msg import Image

from tactile_node.colour_map import ColourScale
from tactile_node.frames.taxel_frame import TaxelStatus
from tactile_node.ros.contact_messages import taxels_of
from tactile_node.ros.taxel_messages import as_array, taxel_values
from tactile_skin.msg import TaxelArray

#: Names of sensor_msgs/image_encodings.hpp
VALUES, COLOURS = '32FC1', 'rgb8'


def value_image(taxels: TaxelArray) -> Image:
    """Return the values as they are [unit of the taxels], NaN = no valid value; of saturated taxels a lower bound."""
    return Image(header=taxels.header, height=taxels.rows, width=taxels.cols, encoding=VALUES,
                 is_bigendian=sys.byteorder == 'big', step=4 * taxels.cols, data=array('B', taxels.values.tobytes()))


def colour_image(taxels: TaxelArray, scale: ColourScale, table: np.ndarray) -> Image:
    """Return the colours of the values by ``scale``; ``table``: `rgb_table`."""
    numbers = scale.numbers(taxel_values(taxels), taxels_of(taxels, TaxelStatus.SATURATED), taxels.unit)
    return Image(header=taxels.header, height=taxels.rows, width=taxels.cols, encoding=COLOURS, is_bigendian=False,
                 step=3 * taxels.cols, data=as_array('B', table[numbers], np.uint8))
