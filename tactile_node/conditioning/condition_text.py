"""The condition of a pad in words: the one place that makes them from its facts."""

from tactile_node.conditioning.tare import ZeroState
from tactile_node.conditioning.taxel_faults import FaultyTaxels, TaxelFault

MOST_NAMED = 20  #: taxels of a kind in the text
#: why the zero of a pad is not valid
ZERO_TEXT = {
    ZeroState.NOT_KNOWN: 'the state of its zero is not known',
    ZeroState.DEVICE_IS_ZEROING: 'its device is zeroing itself',
    ZeroState.DEVICE_PARTLY_ZEROED: 'its device has zeroed itself in part',
    ZeroState.DEVICE_HAS_RESTARTED: 'its device has restarted since it zeroed itself',
    ZeroState.DEVICE_NOT_CHECKED: 'its device has zeroed itself, and the tare that checks it has failed'}


def faults_text(faults: FaultyTaxels) -> str:
    """Return the faulty taxels by kind: 'dead: (3, 4), (5, 0); stuck: (1, 2)', MOST_NAMED of each kind at most."""
    found = {kind: faults.places(kind) for kind in TaxelFault if kind}
    return '; '.join(f'{kind.name.lower()}: {", ".join(map(str, places[:MOST_NAMED]))}'
                     + (f' and {len(places) - MOST_NAMED} more' if len(places) > MOST_NAMED else '')
                     for kind, places in found.items() if places)
