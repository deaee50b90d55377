"""What presses on a pad as one wrench."""

import math
from typing import NamedTuple

from geometry_msgs.msg import Vector3, Wrench, WrenchStamped

from tactile_node.contact.pattern import MOST_LABELS, ContactPattern, of_contact
from tactile_node.contact.visibility import visibility_of
from tactile_node.pose.moments import contact_moments
from tactile_node.press_levels import ON_OFF_UNIT
from tactile_skin.msg import Contact


class _Pressing(NamedTuple):
    force: float  # [N]
    x: float      # of its centre [m]
    y: float


def wrench_message(contact: Contact, pattern: ContactPattern) -> WrenchStamped:
    """Return the wrench that the pressures of all contacts exert on the pad, about the origin of the pad's frame.

    z points out of the skin: what presses has a force.z below 0. With a force F at (x, y) the torque is (-y F, x F, 0).
    Pressures give nothing along x and y and no torque about z: these are 0, whatever shear there is. All six are NaN
    where the force is not known: taxels are hidden where something may press, are saturated, or are on/off.
    ``pattern``: of ``contact``.
    """
    pressing = _known(contact, pattern)
    wrench = Wrench(force=Vector3(), torque=Vector3())
    if pressing is None:
        for part in (wrench.force, wrench.torque):
            part.x = part.y = part.z = math.nan
    else:
        wrench.force.z = 0.0 - sum(each.force for each in pressing)
        wrench.torque.x = 0.0 - sum(each.force * each.y for each in pressing)
        wrench.torque.y = 0.0 + sum(each.force * each.x for each in pressing)
    return WrenchStamped(header=contact.header, wrench=wrench)


def _known(contact: Contact, pattern: ContactPattern) -> list[_Pressing] | None:
    """Return the force and centre of each contact, None unless all of them are known and whole."""
    if not contact.pad_seen or contact.unit == ON_OFF_UNIT or pattern.contacts > MOST_LABELS:
        return None
    found = []
    for number in range(1, pattern.contacts + 1):
        part = of_contact(pattern, number)
        moments = contact_moments(part.values, part.mask, contact.pitch, contact.unit,
                                  visibility_of(part, contact.smallest_contact))
        each = _Pressing(moments.force, *moments.centre_of_pressure)
        if moments.force_is_bound or moments.centre_of_pressure_is_bound or not all(map(math.isfinite, each)):
            return None
        found.append(each)
    return found
