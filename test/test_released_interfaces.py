"""A change of a message, service or action needs a note in the CHANGELOG, because users' nodes depend on it."""

import check_release
import pytest

NOTES = """Changelog

Forthcoming
-----------
* The message ``Grasp`` has a new field

0.1.0 (2027-01-31)
------------------
* The first release; ``Contact``
"""
RELEASED = {'msg/Grasp.msg': ['bool fresh'], 'msg/Contact.msg': ['uint8 A=1', 'uint8 state'], 'srv/Tare.srv': ['---']}


def test_every_change_since_the_latest_release_is_in_the_changelog():
    _, notes = check_release.newest_notes(check_release.CHANGELOG.read_text(encoding='utf-8'))
    _, released = check_release.frozen()
    assert not check_release.unannounced(released, check_release.definitions(), notes), \
        'expected a note in CHANGELOG.rst with the name of each changed interface in double backquotes'


@pytest.mark.parametrize(('change', 'expected'), [
    ({'msg/Grasp.msg': ['bool fresh', 'bool stable']}, []),  # in the notes
    ({'msg/Contact.msg': ['uint8 A=2', 'uint8 state']}, ['msg/Contact.msg']),  # only in the notes of the release
    ({'srv/Tare.srv': None}, ['srv/Tare.srv']),
    ({'action/New.action': ['---', '---']}, ['action/New.action'])])
def test_a_changed_removed_or_new_interface_without_a_note_is_found(change, expected):
    now = {name: lines for name, lines in {**RELEASED, **change}.items() if lines is not None}
    version, notes = check_release.newest_notes(NOTES)
    assert version == 'Forthcoming'
    assert check_release.unannounced(RELEASED, now, notes) == expected


def test_a_comment_or_a_blank_line_is_no_change():
    assert check_release._declared('# What.\n\nuint8   A=1   # one\n---\n') == ['uint8 A=1', '---']
