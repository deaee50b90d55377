"""Gate that checks each request to the web server and forwards only allowed requests.

The web server behind the gate does not check requests. The gate also receives confirmations of page updates (receipts)
from the browsers. Each page update contains a URL under TAKEN_PATH, which the browser requests once it has applied the
update.

The gate listens on this machine only. To view the page from another machine, forward the port with ssh. Each request
must name this machine in its Host header. Without this check, any web page open in the browser could read the skin by
DNS rebinding or cross-site WebSockets.
"""

import asyncio
import ipaddress
import re
import socket
from collections.abc import Callable, Coroutine
from http import HTTPStatus
from typing import NamedTuple
from urllib.parse import urlsplit

from tactile_node.errors import ConfigurationError
from tactile_node.threads import ReportedThread

LOOPBACK = '127.0.0.1'
LARGEST_HEAD = 16_384  #: maximum size of a request line and its headers [bytes]
HEAD_TIMEOUT = 10.0    #: timeout for receiving a request line and its headers [s]
PASSED_CHUNK = 65_536         #: maximum number of bytes forwarded at once
SEND_BUFFER = 131_072  #: size of the send buffer for a browser [bytes], kept small because buffered data become stale

#: called with a page number and the number of the update that the browser has confirmed
OnTaken = Callable[[int, int], None]
TAKEN_PATH = '/taken'


class Request(NamedTuple):
    """Request line and headers of an HTTP request, with header names in lower case."""

    method: str
    target: str
    headers: dict[str, str]

    @property
    def receipt(self) -> tuple[int, int] | None:
        """Page number and update number confirmed by this request, or None if the request is not a receipt."""
        found = re.fullmatch(rf'{TAKEN_PATH}/(\d{{1,9}})/(\d{{1,12}})', self.target)
        return None if found is None else (int(found[1]), int(found[2]))

    @property
    def is_websocket(self) -> bool:
        return self.headers.get('upgrade', '').lower() == 'websocket'


#: response to a receipt, which keeps the connection open for the next receipt
RECEIPT_ANSWER = b'HTTP/1.1 204 No Content\r\nCache-Control: no-store\r\n\r\n'


def refusal(status: HTTPStatus) -> bytes:
    """Return the HTTP response that refuses a request with ``status``."""
    text = f'{status.value} {status.phrase}\n'
    return (f'HTTP/1.1 {status.value} {status.phrase}\r\nContent-Type: text/plain\r\nContent-Length: {len(text)}\r\n'
            f'Connection: close\r\nCache-Control: no-store\r\n\r\n{text}').encode()


def is_loopback(host: str) -> bool:
    """Return True if only this machine can reach ``host``, which may include a port.

    >>> is_loopback('localhost:80'), is_loopback('127.0.0.2'), is_loopback('0.0.0.0'), is_loopback('robot')
    (True, True, False, False)
    """
    try:
        name = urlsplit(f'//{host}').hostname or ''
        return name == 'localhost' or ipaddress.ip_address(name).is_loopback
    except ValueError:
        return False


def parse_request(head: bytes) -> Request | None:
    """Parse ``head`` and return the request, or None if ``head`` is not a valid HTTP request."""
    first, *lines = head.decode('latin-1').split('\r\n')
    pairs = [(name.lower(), value.strip()) for name, _, value in (line.partition(':') for line in lines if line)]
    names = [name for name, _ in pairs]
    try:
        method, target, _ = first.split(' ')
        request = Request(method, target, dict(pairs))
        for url in (target, request.headers.get('origin', '')):
            urlsplit(url)
    except ValueError:
        return None
    return None if any(names.count(name) > 1 for name in ('host', 'origin', 'upgrade')) else request


def check_request(request: Request) -> HTTPStatus | None:
    """Return the reason why ``request`` is refused, or None if it may pass."""
    if request.method != 'GET':
        return HTTPStatus.METHOD_NOT_ALLOWED
    host = request.headers.get('host', '')
    origin = request.headers.get('origin')
    if request.is_websocket and origin is not None and urlsplit(origin).netloc != host:
        return HTTPStatus.FORBIDDEN
    return None if is_loopback(host) else HTTPStatus.FORBIDDEN


class Gate:
    """Listens on a port of this machine and forwards allowed requests to the server until `close` is called.

    Parameters
    ----------
    port
        TCP port, or 0 for any free port.
    inner
        Host and port of the server.
    on_taken
        Called with the page number and update number of each receipt.

    Raises
    ------
    ConfigurationError
        Raised if the port is already in use.
    """

    def __init__(self, port: int, inner: tuple[str, int], on_taken: OnTaken = lambda page, update: None):
        self._inner, self._on_taken = inner, on_taken
        self._loop = asyncio.new_event_loop()
        self._thread = ReportedThread(self._loop.run_forever, 'view_gate')
        self._thread.start()
        try:
            self._server = self._call(asyncio.start_server(self._connected, LOOPBACK, port, limit=LARGEST_HEAD))
        except OSError as error:
            self._end()
            raise ConfigurationError(f'{LOOPBACK}:{port}', expected='a free port', got=str(error),
                                     remedy='Give another --port.') from None
        self.port: int = self._server.sockets[0].getsockname()[1]

    def close(self) -> None:
        self._call(_closed(self._server))
        self._end()

    def _call(self, coroutine: Coroutine):
        return asyncio.run_coroutine_threadsafe(coroutine, self._loop).result()

    def _end(self) -> None:
        self._loop.call_soon_threadsafe(self._loop.stop)
        self._thread.join()
        self._loop.close()

    async def _connected(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        try:
            while await self._answered(reader, writer):
                pass
        except (OSError, EOFError, asyncio.TimeoutError, asyncio.LimitOverrunError):
            pass  # the browser disconnected, or the client was not a browser
        finally:
            writer.close()

    async def _answered(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> bool:
        """Process one request. Return True if another request may follow on the same connection."""
        head = await asyncio.wait_for(reader.readuntil(b'\r\n\r\n'), HEAD_TIMEOUT)
        request = parse_request(head)
        status = HTTPStatus.BAD_REQUEST if request is None else check_request(request)
        if request is None or status is not None:
            writer.write(refusal(status or HTTPStatus.BAD_REQUEST))
        elif request.receipt is not None:
            self._on_taken(*request.receipt)
            writer.write(RECEIPT_ANSWER)
        else:
            await self._pass_on(head, request.is_websocket, reader, writer)
        await writer.drain()
        return request is not None and status is None and request.receipt is not None

    async def _pass_on(self, head: bytes, both_ways: bool, reader: asyncio.StreamReader,
                       writer: asyncio.StreamWriter) -> None:
        """Forward a request. Only a WebSocket may send more data, because a second request would bypass the check."""
        writer.get_extra_info('socket').setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, SEND_BUFFER)
        inner_reader, inner_writer = await asyncio.open_connection(*self._inner, limit=PASSED_CHUNK)
        try:
            inner_writer.write(head)
            ways = [asyncio.create_task(_copy(inner_reader, writer))]
            if both_ways:
                ways.append(asyncio.create_task(_copy(reader, inner_writer)))
            await asyncio.wait(ways, return_when=asyncio.FIRST_COMPLETED)
            for way in ways:
                way.cancel()
            await asyncio.gather(*ways, return_exceptions=True)
        finally:
            inner_writer.close()


async def _copy(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
    """Copy data only as fast as the receiver accepts it, so that no backlog builds up."""
    while data := await reader.read(PASSED_CHUNK):
        writer.write(data)
        await writer.drain()


async def _closed(server: asyncio.Server) -> None:
    server.close()
    tasks = asyncio.all_tasks() - {asyncio.current_task()}
    for task in tasks:
        task.cancel()
    await asyncio.gather(*tasks, return_exceptions=True)
