"""Recognise contact shapes with a tactile skin.

The package reports the shape, the place and the size of each contact on an array of taxels, and how certain the result
is.

>>> import numpy as np
>>> import tactile_node as tn
>>> contact = tn.find_contact(np.pad(np.full((7, 7), 50e3), 4), unit='Pa')  # thresholds are those of the nodes
>>> tn.Recogniser().recognise(contact).shape.value
'square'
>>> round(tn.fit_shape(contact, tn.Shape.SQUARE, pitch=0.004).dimensions[0], 3)                     # metre
0.028

Most folders hold one stage of the data flow: CAN frame, taxel frame, contact pattern, features, shape.
``docs/architecture.md`` states which folder may import which.
"""

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from tactile_node.contact.pattern import ContactPattern
    from tactile_node.contact.press import PressThresholds
    from tactile_node.errors import ConfigurationError, InputError, TactileError
    from tactile_node.helmholtz.features import Features, Group
    from tactile_node.library.contacts import (
        Recogniser,
        contact_box,
        find_contact,
        fit_shape,
        paper_features,
        plot_frame,
    )
    from tactile_node.library.stream import ContactStream
    from tactile_node.pose.box import ContactBox
    from tactile_node.pose.fit import ShapeFit
    from tactile_node.pose.pipeline import StreamedContact
    from tactile_node.shape.fusion import FusedRecognition, FusionSettings
    from tactile_node.shape.recognition import Recognition, Shape, UnknownReason

    __version__: str

__all__ = ['__version__', 'find_contact', 'paper_features', 'Recogniser', 'fit_shape', 'contact_box', 'ContactStream',
           'plot_frame', 'PressThresholds', 'Group', 'Shape', 'UnknownReason', 'ContactPattern', 'ContactBox',
           'Features', 'Recognition', 'ShapeFit', 'FusedRecognition', 'FusionSettings', 'StreamedContact',
           'TactileError', 'InputError', 'ConfigurationError']

#: Public names by module. A module is imported when one of its names is first used, so that nodes start quickly.
_HOMES = {
    'contact.pattern': ('ContactPattern',),
    'contact.press': ('PressThresholds',),
    'errors': ('ConfigurationError', 'InputError', 'TactileError'),
    'shape.fusion': ('FusedRecognition', 'FusionSettings'),
    'helmholtz.features': ('Features', 'Group'),
    'library.contacts': ('Recogniser', 'contact_box', 'find_contact', 'fit_shape', 'paper_features',
                         'plot_frame'),
    'library.stream': ('ContactStream',),
    'pose.box': ('ContactBox',),
    'pose.fit': ('ShapeFit',),
    'pose.pipeline': ('StreamedContact',),
    'shape.recognition': ('Recognition', 'Shape', 'UnknownReason'),
}


def __getattr__(name: str) -> object:
    if name == '__version__':
        return import_module('tactile_node.package_files').package_version()
    for module, names in _HOMES.items():
        if name in names:
            return getattr(import_module(f'{__name__}.{module}'), name)
    raise AttributeError(f'module {__name__!r} has no attribute {name!r}')


def __dir__() -> list[str]:
    return sorted(__all__)
