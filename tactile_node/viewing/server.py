"""Web server for the page: viser on loopback behind a gate. The source runs while at least one browser shows the page.
"""

import io
import secrets
import socket
import threading
from contextlib import redirect_stdout
from typing import TYPE_CHECKING

from tactile_node.threads import ReportedThread, call_guarded
from tactile_node.viewing.gate import LOOPBACK, Gate
from tactile_node.viewing.page import Page
from tactile_node.viewing.source import ViewSource

if TYPE_CHECKING:
    from viser import ClientHandle

#: time for which the source keeps running without a browser [s], in case a browser is only reloading the page
LINGER_TIME = 2.0


class ViewServer:
    """Serves the page until `close` is called. Raises ConfigurationError if the port is in use."""

    def __init__(self, source: ViewSource, port: int = 8080, full_scale: float | None = None):
        import viser
        self._source, self._full_scale = source, full_scale
        self._changed = threading.Condition()
        self._pages: dict[int, Page] = {}
        self._is_closing = False
        self.is_source_on = False
        with redirect_stdout(io.StringIO()):  # viser's message would show the address behind the gate
            inner_host = _inner_host()
            self._viser = viser.ViserServer(host=inner_host, port=0, verbose=False)
        # Without this override, a browser could request a tunnel through a server on the internet.
        self._viser.request_share_url = lambda verbose=True: None  # type: ignore[method-assign]
        try:
            self._gate = Gate(port, (inner_host, self._viser.get_port()), self._taken)
        except BaseException:
            self._stop_viser()
            raise
        self.port = self._gate.port
        self._viser.on_client_connect(self._connected)
        self._viser.on_client_disconnect(self._disconnected)
        self._thread = ReportedThread(self._switch_source, 'view_server')
        self._thread.start()

    def close(self) -> None:
        with self._changed:
            self._is_closing = True
            pages = list(self._pages.values())
            self._changed.notify_all()
        for page in pages:
            page.stop()
        self._source.store.close()
        self._gate.close()
        self._stop_viser()
        self._thread.join()
        for page in pages:
            page.join()

    def _connected(self, client: 'ClientHandle') -> None:
        def is_connected() -> bool:
            return client.client_id in self._viser.get_clients()

        page = Page(client, self._source, is_connected, self._full_scale)
        with self._changed:
            # viser calls from many threads, so the client may have disconnected
            if self._is_closing or not is_connected():
                return
            self._pages[client.client_id] = page
            self._changed.notify_all()
        page.start()

    def _disconnected(self, client: 'ClientHandle') -> None:
        with self._changed:
            page = self._pages.pop(client.client_id, None)
            self._changed.notify_all()
        if page is not None:
            page.stop()

    def _taken(self, number: int, update: int) -> None:
        page = self._pages.get(number)
        if page is not None:
            page.taken(update)

    def _switch_source(self) -> None:
        """Start and stop the source on one thread, so that a start never overlaps with a stop or another start."""
        while True:
            with self._changed:
                self._changed.wait_for(lambda: self._is_closing or bool(self._pages) != self.is_source_on)
                if self.is_source_on:
                    self._changed.wait_for(lambda: self._is_closing or bool(self._pages), LINGER_TIME)
                is_wanted = bool(self._pages) and not self._is_closing
            if is_wanted != self.is_source_on:
                error = call_guarded(self._source.start if is_wanted else self._source.stop)
                if error is not None:  # the next browser will start the source again
                    self._source.store.put_error(error)
                self.is_source_on = is_wanted
            if self._is_closing and not self.is_source_on:
                return

    def _stop_viser(self) -> None:
        with redirect_stdout(io.StringIO()):
            self._viser.stop()


def _inner_host() -> str:
    """Return a random address in 127.0.0.0/8.

    viser checks neither the Host nor the Origin header, so a web page could try all ports of a known address.
    """
    host = '127.' + '.'.join(str(1 + secrets.randbelow(254)) for _ in range(3))
    with socket.socket() as probe:
        try:
            probe.bind((host, 0))
        except OSError:  # on systems other than Linux, only 127.0.0.1 works
            return LOOPBACK
    return host
