"""Recent facts about a bus, with which present facts are compared."""

from collections import deque

from tactile_node.assembly.facts import BusFacts


class FactsHistory:
    """History of the facts about one bus over the last ``window`` seconds, which tells recent losses from earlier ones.

    Parameters
    ----------
    window : float
        Length of the history [s].
    """

    def __init__(self, window: float):
        self._window = window
        self._known: deque[tuple[float, BusFacts]] = deque()  # in ascending order of time; the first is the reference

    def before(self, facts: BusFacts, now: float) -> tuple[BusFacts, float]:
        """Add ``facts`` and return earlier facts for comparison.

        If the counters have decreased, the driver has restarted, and earlier facts are forgotten.

        Parameters
        ----------
        facts : BusFacts
            Present facts.
        now : float
            Time of the facts [s]. Facts are not added again if the time has not advanced.

        Returns
        -------
        BusFacts
            Latest facts that are at least ``window`` old, or the oldest facts available.
        float
            Age of the returned facts [s].
        """
        known = self._known
        if known and _expected(facts) < _expected(known[-1][1]):
            known.clear()
        if not known or now > known[-1][0]:
            known.append((now, facts))
        while len(known) > 1 and now - known[1][0] >= self._window:
            known.popleft()
        return known[0][1], now - known[0][0]


def _expected(facts: BusFacts) -> int:
    return sum(pad.tpdos_expected for pad in facts.pads)
