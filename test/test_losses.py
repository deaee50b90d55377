"""The codes and names of the reasons for losses are part of the interface."""

from tactile_node.assembly.facts import BusFacts, LossReason, PadFacts
from tactile_node.sources.log_source import summary


def test_codes_and_names_of_the_reasons_are_stable():
    assert {reason.value: reason.key for reason in LossReason} == {
        1: 'before_first_sync', 2: 'out_of_order', 3: 'late', 4: 'duplicate', 5: 'surplus', 6: 'short',
        7: 'unknown_row', 8: 'over_long', 9: 'broken', 10: 'incomplete', 11: 'unfinished'}


def test_summary_names_every_loss():
    losses = dict.fromkeys(LossReason, 0) | {LossReason.LATE: 2, LossReason.OVER_LONG: 1}
    pad = PadFacts('left', 3, 1, tpdos_expected=8, tpdos_received=9, tpdos_used=6, losses=losses, tpdos_padded=5)
    text = summary(BusFacts((pad,), can_frames={'tpdo': 9, 'sync': 4}))
    assert text.splitlines() == [
        'left: 4 taxel frames, 3 complete, 1 incomplete; TPDOs: 8 expected, 2 brought no taxels; 9 received: 6 used, '
        '2 late, 1 over_long; 5 padded',
        'CAN frames: 13 (4 sync, 9 tpdo); lines unread: 0']
