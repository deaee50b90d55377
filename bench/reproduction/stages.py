"""Progress of work in stages on stderr, by tqdm; silent where that is no terminal."""

from tqdm import tqdm

SHARE = '{desc}: {percentage:3.0f}% |{bar}| {elapsed}, {remaining} left'


class Stages:
    """A bar for work in stages, some of which know what share of them is done."""

    def __init__(self) -> None:
        self._bar: tqdm | None = None
        self._stage = ''

    def show(self, stage: str, share: float | None = None) -> None:
        """Begin ``stage``, or go on with it up to ``share``."""
        if self._bar is None or stage != self._stage:
            self.close()
            form = '{desc} ({elapsed})' if share is None else SHARE
            self._bar = tqdm(desc=stage, total=1.0, bar_format=form, disable=None, dynamic_ncols=True)
            self._stage = stage
        if share is not None:
            self._bar.update(share - self._bar.n)

    def close(self) -> None:
        if self._bar is not None:
            self._bar.close()
