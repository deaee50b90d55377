"""Slider and button of a recording."""

from typing import TYPE_CHECKING

from tactile_node.view.source import Player

if TYPE_CHECKING:
    from viser import GuiApi

STEP = 0.05  #: of the slider [s]


class PlayerControls:
    """Adds them to ``gui``; `update` lets them follow what plays."""

    def __init__(self, gui: 'GuiApi', player: Player):
        self._player = player
        self._button = gui.add_button('Pause')
        self._slider = gui.add_slider('time [s]', min=0.0, max=STEP, step=STEP, initial_value=0.0)
        self._button.on_click(lambda event: player.play(not player.is_playing))
        self._slider.on_update(self._moved)

    def update(self) -> None:
        self._button.label = 'Pause' if self._player.is_playing else 'Play'
        self._slider.max = max(self._player.length, STEP)
        if self._player.is_playing:
            self._slider.value = min(self._player.position, self._slider.max)  # type: ignore[misc]

    def _moved(self, event) -> None:
        if event.client is not None:  # a person, not `update`
            self._player.play(False)
            self._player.seek(self._slider.value)
