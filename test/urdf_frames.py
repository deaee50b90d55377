"""Computes the frames of a robot from its description like robot_state_publisher, but independently of the package."""

from pathlib import Path
from typing import NamedTuple
from xml.etree import ElementTree

import numpy as np
import xacro
from scipy.spatial.transform import Rotation

URDF = Path(__file__).resolve().parents[1] / 'urdf'


class Joint(NamedTuple):
    name: str
    kind: str
    parent: str
    child: str
    origin: np.ndarray  #: (4, 4)
    axis: np.ndarray


def expand(name: str) -> ElementTree.Element:
    """Expand a xacro file in urdf/, or the given text as if it were in that folder."""
    document = xacro.process_file(str(URDF / name))
    return ElementTree.fromstring(document.toxml())


def joints(robot: ElementTree.Element) -> list[Joint]:
    return [Joint(each.get('name'), each.get('type'), each.find('parent').get('link'), each.find('child').get('link'),
                  _origin(each.find('origin')), _numbers(each.find('axis'), 'xyz')) for each in robot.findall('joint')]


def transform(joint: Joint, positions: dict[str, float]) -> np.ndarray:
    """Return the transform from the joint's child to its parent, (4, 4)."""
    moved = np.eye(4)
    if joint.kind == 'prismatic':
        moved[:3, 3] = joint.axis * positions[joint.name]
    return joint.origin @ moved


def place(robot: ElementTree.Element, link: str, positions: dict[str, float]) -> np.ndarray:
    """Return the transform from ``link`` to the root link, (4, 4)."""
    above = {joint.child: joint for joint in joints(robot)}
    found = np.eye(4)
    while link in above:
        found = transform(above[link], positions) @ found
        link = above[link].parent
    return found


def _origin(element: ElementTree.Element | None) -> np.ndarray:
    made = np.eye(4)
    made[:3, :3] = Rotation.from_euler('xyz', _numbers(element, 'rpy')).as_matrix()
    made[:3, 3] = _numbers(element, 'xyz')
    return made


def _numbers(element: ElementTree.Element | None, key: str) -> np.ndarray:
    text = element.get(key) if element is not None else None
    return np.array([float(number) for number in (text or '0 0 0').split()])
