"""Describe a contact in words, for all views and the report."""

import math

from tactile_node.viewing.states import SeenContact


def contact_text(contact: SeenContact | None) -> str:
    """Describe a contact in one line: shape, confidence, size, force and motion.

    Examples
    --------
    >>> contact_text(SeenContact('square', '', {'square': 0.97}, None, (('side', 0.028),), False, 1.5, None))
    'square 97 %, side 28.0 mm, 1.50 N'
    """
    if contact is None:
        return 'not recognised: no shape comes with these taxels'
    shape = shape_text(contact)
    if contact.shape not in ('unknown', 'none'):
        shape += f' {100 * contact.confidence:.0f} %'
    force = '' if contact.shape == 'none' else force_text(contact)
    return ', '.join(filter(None, (shape, size_text(contact), force, contact.moves)))


def shape_text(contact: SeenContact) -> str:
    """Return the name of the shape, with the reason if the shape is unknown."""
    if contact.shape == 'none':
        return 'nothing touches'
    return _words(contact.shape) + (f' ({_words(contact.reason)})' if contact.reason else '')


def size_text(contact: SeenContact) -> str:
    """Return the lengths of the outline, or '' without an outline. "≥" marks lower bounds."""
    bound = '≥ ' if contact.size_is_bound else ''
    return ', '.join(f'{_words(name)} {bound}{1e3 * length:.1f} mm' for name, length in contact.dimensions)


def force_text(contact: SeenContact) -> str:
    """Return the force, or '' if the force is not known. "≥" marks a lower bound."""
    return '' if math.isnan(contact.force) else f'{"≥ " if contact.force_is_bound else ""}{contact.force:.2f} N'


def _words(name: str) -> str:
    return name.replace('_', ' ')
