"""The page in one browser. The page is updated only as fast as the browser accepts updates."""

import math
import threading
import time
from collections import deque
from collections.abc import Callable, Sequence
from html import escape
from typing import TYPE_CHECKING

import numpy as np

from tactile_node.assembly.facts_history import FactsHistory
from tactile_node.threads import ReportedThread
from tactile_node.viewing.chart import POINT_COLOURS, Series, chart
from tactile_node.viewing.counts_table import RECENT_TIME, counts_table
from tactile_node.viewing.drawn_pad import DrawnPad, Scales
from tactile_node.viewing.page_parts import PageFacts, macros, pads_html, status_html
from tactile_node.viewing.planes import planes_html
from tactile_node.viewing.source import FORCE_HISTORY, ViewSource, ViewState

if TYPE_CHECKING:
    from viser import ClientHandle, GuiApi

    from tactile_node.viewing.recording_source import RecordingSource

UPDATE_RATE = 17.5  #: maximum update rate [1/s]
SLOW_PERIOD = 0.2   #: minimum update period of the chart and tables [s]
PAUSE_SHARE = 5.0    #: pause after an update of the chart and tables, as a multiple of the update's duration
LONGEST_SILENCE = 0.4  #: longest time between updates, so that displayed ages advance without new data [s]
CONNECTION_PERIOD = 0.2  #: period at which the connection to the browser is checked [s]
MEASURED_TIME = 3.0  #: averaging time of the displayed rate and delay [s]
PADS_WIDTH = 720.0   #: minimum width of the panel with the pads [pixels]
HEALTH_WIDTH = 380.0  #: width of the panel with the health table [pixels]
SLIDER_STEP = 0.05  #: [s]


FORCE_GAP = 0.3     #: time between two forces above which the line is interrupted [s]


def force_chart(forces: Sequence[np.ndarray], now: float) -> str:
    """Return a chart of the force over the last FORCE_HISTORY seconds.

    Parameters
    ----------
    forces
        Stamps [s] and forces [N] of each pad, shape (2, n). The line has gaps where no force was measured.
    now
        Stamp at the right edge of the chart [s].
    """
    drawn = chart([Series(POINT_COLOURS[k % len(POINT_COLOURS)], stamps - now, values, FORCE_GAP)
                   for k, (stamps, values) in enumerate(forces)], -FORCE_HISTORY, 0.0, 'N')
    return str(drawn)  # viser sends only plain str


class PlayerControls:
    """Playback controls for a recording, which `update` synchronises with the player."""

    def __init__(self, gui: 'GuiApi', player: 'RecordingSource'):
        self._player = player
        self._button = gui.add_button('Pause')
        self._slider = gui.add_slider('time [s]', min=0.0, max=SLIDER_STEP, step=SLIDER_STEP, initial_value=0.0)
        self._button.on_click(lambda event: player.play(not player.is_playing))
        self._slider.on_update(self._moved)

    def update(self) -> None:
        self._button.label = 'Pause' if self._player.is_playing else 'Play'
        self._slider.max = max(self._player.length, SLIDER_STEP)
        if self._player.is_playing:
            self._slider.value = min(self._player.position, self._slider.max)  # type: ignore[misc]

    def _moved(self, event) -> None:
        if event.client is not None:  # event.client is None if `update` moved the slider
            self._player.play(False)
            self._player.seek(self._slider.value)


class Page:
    """Updates one browser from `start` to `stop`, with at most one update in flight.

    Each update waits until the browser has confirmed the previous update. Data therefore never queue up for a slow
    browser, and the browser is never more than one update behind. Data that may be marked as live are sent first, in an
    update of their own, so that they arrive quickly. The chart and the tables follow in a separate update.
    """

    def __init__(self, client: 'ClientHandle', source: ViewSource, is_connected: Callable[[], bool],
                 full_scale: float = 0.0):
        self._client, self._source = client, source
        self._is_connected = is_connected
        self._scales = Scales(full_scale)
        self._stopping = threading.Event()
        self._thread = ReportedThread(self._run, f'view_page_{client.client_id}')
        self._taken: deque[tuple[float, float]] = deque()  # time of each receipt, and age of the data at that time [s]
        self._number = 0
        self._is_taken = threading.Event()
        self._receipt_time = 0.0  # time of the last receipt [s]
        self._slow_due = 0.0
        self._history = FactsHistory(RECENT_TIME)

    def start(self) -> None:
        self._thread.start()

    def stop(self) -> None:
        self._stopping.set()

    def join(self) -> None:
        if self._thread is not threading.current_thread():
            self._thread.join()

    def _run(self) -> None:
        try:
            self._build()
            version = -1
            while not self._stopping.is_set():
                self._source.store.wait(version, LONGEST_SILENCE)
                begun = time.monotonic()
                shown = self._source.store.shown()
                version = shown.version
                drawn = [pad._replace(since_receipt=begun - self._receipt_time)
                         for pad in self._scales.drawn_now(self._source, shown)]
                self._update_pads(shown, drawn, begun)
                if not self._has_answered():
                    return
                now = self._receipt_time
                self._taken.append((now, min((pad.age for pad in drawn), default=math.inf) + now - begun))
                if not self._has_taken_rest(shown, drawn):
                    return
                self._stopping.wait(max(0.0, begun + 1 / UPDATE_RATE - time.monotonic()))
        except Exception:
            if not self._stopping.is_set() and self._is_connected():
                raise

    def _build(self) -> None:
        gui = self._client.gui
        gui.configure_theme(show_logo=False, show_share_button=False, control_width='large')
        gui.set_panel_label('tactile view')
        title = escape(f'{", ".join(self._source.store.pads)} - tactile_skin', quote=True)
        script = escape(str(macros().script()), quote=True)
        gui.add_html(f'{macros().style()}<img hidden src="data:," alt="{title}" onerror="{script}">')
        self._status = gui.add_html('')
        self._receipt = gui.add_html('')
        self._controls = None if self._source.player is None else PlayerControls(gui, self._source.player)
        with gui.add_folder('Bus and taxels'):
            self._health = gui.add_html('')
        with gui.add_folder('Planes of Volf, Dvořák and Vlček'):
            self._planes_wanted = gui.add_checkbox('show (computed only then)', False)
            self._planes_html = gui.add_html('')
        gui.main_panel.dock_right()
        gui.main_panel.set_width(HEALTH_WIDTH)
        panel = gui.add_panel()
        with panel.add_tab('Pads'):
            self._pads = gui.add_html('')
            self._force = gui.add_html('')
            gui.add_html(str(macros().legend()))
        panel.dock_left()
        panel.set_width(max(PADS_WIDTH, self._client.camera.image_width - HEALTH_WIDTH))

    def _update_pads(self, shown: ViewState, drawn: list[DrawnPad], now: float) -> None:
        self._is_taken.clear()
        self._number += 1
        self._pads.content = pads_html(drawn, self._number, self._source.player is not None)
        self._status.content = status_html(self._facts(shown, now), drawn, self._client.client_id, self._number)
        self._client.flush()

    def _has_taken_rest(self, shown: ViewState, drawn: list[DrawnPad]) -> bool:
        """Send the chart and tables if due, and wait. Return False if the browser has disconnected."""
        begun = time.monotonic()
        if begun < self._slow_due:
            return True
        self._is_taken.clear()
        self._number += 1
        self._update_slow(shown, drawn)
        self._receipt.content = str(macros().receipt(self._client.client_id, self._number))
        self._client.flush()
        if not self._has_answered():
            return False
        self._slow_due = begun + max(SLOW_PERIOD, PAUSE_SHARE * (time.monotonic() - begun))
        return True

    def _facts(self, shown: ViewState, now: float) -> PageFacts:
        while self._taken and now - self._taken[0][0] > MEASURED_TIME:
            self._taken.popleft()
        player = self._source.player
        ages = [age for _, age in self._taken if math.isfinite(age)]
        return PageFacts(
            title=self._source.title, player=player, problem=shown.problem, rate=len(self._taken) / MEASURED_TIME,
            delay=sum(ages) / len(ages) if ages and player is None else math.nan,
            grasp=shown.grasp)

    def _update_slow(self, shown: ViewState, drawn: list[DrawnPad]) -> None:
        ends = [pad.state.stamp + pad.age for pad in drawn if pad.state is not None and math.isfinite(pad.age)]
        if ends:
            self._force.content = force_chart([self._source.store.forces(name) for name in shown.pads], max(ends))
        age, before = time.monotonic() - shown.bus_acquired, None
        if shown.bus is not None and self._source.player is None:
            before = self._history.before(shown.bus, shown.bus_acquired)
        self._health.content = counts_table(shown.bus, age, before)
        if self._controls is not None:
            self._controls.update()
        self._planes_html.content = self._planes_picture(drawn) if self._planes_wanted.value else ''

    def _planes_picture(self, drawn: list[DrawnPad]) -> str:
        return planes_html({
            number: pad.state.contact.mask for number, pad in enumerate(drawn) if pad.is_live
            and pad.state is not None and pad.state.contact is not None and pad.state.contact.mask is not None})

    def taken(self, number: int) -> None:
        """Record that the browser has applied update ``number``. Any thread may call this method."""
        if number == self._number:
            self._is_taken.set()

    def _has_answered(self) -> bool:
        """Wait until the browser has confirmed the update. Return False if the browser has disconnected."""
        while not self._stopping.is_set() and self._is_connected():
            if self._is_taken.wait(CONNECTION_PERIOD):
                self._receipt_time = time.monotonic()
                return True
        return False
