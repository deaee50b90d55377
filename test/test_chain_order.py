"""The order in which the chain runs the postponed steps of two pads."""

from collections.abc import Iterator

import pytest

from tactile_node.chain import Chain, Step

LIVENESS = 60.0  # Longest wait for the chain on a busy machine [s].


@pytest.fixture
def chain() -> Iterator[Chain]:
    chain = Chain()
    chain.start()
    yield chain
    chain.stop(LIVENESS)


@pytest.mark.parametrize('later', [0.0, 3e-6])
def test_the_shapes_of_all_pads_for_one_sync_come_before_messages_for_viewers(chain, later):
    """The times of two pads differ a little, because the driver reads the clocks separately for each pad."""
    order = []

    def recognise(pad: str, acquired: float) -> None:
        order.append(f'shape {pad}')
        chain.postpone(Step.SHOW, acquired, order.append, f'markers {pad}')

    def find() -> None:
        for sync in (1.0, 1.02):
            for pad, acquired in (('left', sync), ('right', sync + later)):
                chain.postpone(Step.RECOGNISE, acquired, recognise, pad, acquired)
    chain.post(find)
    assert chain.wait_until_idle(LIVENESS)
    assert order == 2 * ['shape left', 'shape right', 'markers left', 'markers right']
