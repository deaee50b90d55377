"""Who may look: stands before the page's server, which refuses no one, and passes on what may pass.

It also takes the browsers' receipts: an update of a page holds an empty picture of the address TAKEN, for which a
browser asks when it has put the update on its page.

A browser on this machine needs no token, but must have asked for this machine: else any web page that is open in it
could read the skin (DNS rebinding, cross-site WebSockets). From elsewhere a token is needed, first in the address
(?token=...), then in a cookie. The token is compared in constant time.
"""

import asyncio
import hmac
import ipaddress
import re
import socket
import threading
from collections.abc import Callable, Coroutine
from http import HTTPStatus
from typing import NamedTuple
from urllib.parse import parse_qs, urlsplit

from tactile_node.errors import ConfigurationError

LARGEST_HEAD = 16_384  #: of a request [bytes]
HEAD_TIMEOUT = 10.0    #: s
CHUNK = 65_536         #: passed on at once [bytes]
SEND_BUFFER = 131_072  #: of a connection to a browser [bytes]: what waits in it becomes old
TOKEN = r'[A-Za-z0-9_-]{16,}'  #: what a cookie and an address can hold, and no one guesses

#: Called with the number of a page and of the update that it has taken
OnTaken = Callable[[int, int], None]
TAKEN = '/taken'


class Request(NamedTuple):
    """The head of an HTTP request; names of headers are in lower case."""

    method: str
    target: str
    headers: dict[str, str]

    @property
    def receipt(self) -> tuple[int, int] | None:
        """Page and update of which this is the receipt; None for another request."""
        found = re.fullmatch(rf'{TAKEN}/(\d{{1,9}})/(\d{{1,12}})', self.target)
        return None if found is None else (int(found[1]), int(found[2]))

    @property
    def is_websocket(self) -> bool:
        return self.headers.get('upgrade', '').lower() == 'websocket'


#: An answer after which the connection stays: a receipt comes with each update
RECEIVED = b'HTTP/1.1 204 No Content\r\nCache-Control: no-store\r\n\r\n'


class Answer(NamedTuple):
    """What is answered instead of passing a request on."""

    status: HTTPStatus
    headers: tuple[tuple[str, str], ...] = ()

    def as_bytes(self) -> bytes:
        text = f'{self.status.value} {self.status.phrase}\n'.encode()
        fields = (('Content-Type', 'text/plain'), ('Content-Length', str(len(text))), ('Connection', 'close'),
                  ('Cache-Control', 'no-store'), ('Referrer-Policy', 'no-referrer'), *self.headers)
        head = ''.join(f'{name}: {value}\r\n' for name, value in fields)
        return f'HTTP/1.1 {self.status.value} {self.status.phrase}\r\n{head}\r\n'.encode() + text


def is_loopback(host: str) -> bool:
    """Return whether only this machine can reach ``host``.

    >>> is_loopback('localhost'), is_loopback('127.0.0.2'), is_loopback('0.0.0.0'), is_loopback('robot')
    (True, True, False, False)
    """
    try:
        return host == 'localhost' or ipaddress.ip_address(host).is_loopback
    except ValueError:
        return False


def check_token(host: str, token: str) -> None:
    """Raise ConfigurationError for an address that others reach without a token, and for one that can be guessed."""
    if not token and not is_loopback(host):
        raise ConfigurationError(f'--host {host}', expected='a token for other addresses than this machine',
                                 got='none', remedy='Give --token auto, or leave out --host and forward the port by '
                                 'ssh -L.')
    if token and not re.fullmatch(TOKEN, token):
        raise ConfigurationError('--token', expected='16 or more letters, digits, - and _',
                                 got=f'{len(token)} characters', remedy='Give auto for a random one.')


def parsed(head: bytes) -> Request | None:
    """Return the request of ``head``; None where it is none."""
    lines = head.decode('latin-1').split('\r\n')
    first = lines[0].split(' ')
    if len(first) != 3:
        return None
    pairs = [line.partition(':') for line in lines[1:] if line]
    names = [name.lower() for name, _, _ in pairs]
    if any(names.count(name) > 1 for name in ('host', 'origin', 'cookie', 'upgrade')):
        return None
    request = Request(first[0], first[1], {name.lower(): value.strip() for name, _, value in pairs})
    return request if _is_url(request.target) and _is_url(request.headers.get('origin', '')) else None


class Rules:
    """Decides about each request; ``token`` '' : of this machine only."""

    def __init__(self, token: str, port: int):
        self._token = token
        self._cookie = f'tactile_view_{port}'  # cookies do not distinguish ports

    def answer(self, request: Request) -> Answer | None:
        """Return what to answer; None: pass it on."""
        if request.method != 'GET':
            return Answer(HTTPStatus.METHOD_NOT_ALLOWED)
        host = request.headers.get('host', '')
        origin = request.headers.get('origin')
        if request.is_websocket and origin is not None and urlsplit(origin).netloc != host:
            return Answer(HTTPStatus.FORBIDDEN)
        if not self._token:
            return None if is_loopback(_hostname(host)) else Answer(HTTPStatus.FORBIDDEN)
        if given := parse_qs(urlsplit(request.target).query).get('token'):
            return self._entry() if self._is_right(given[0]) else Answer(HTTPStatus.FORBIDDEN)
        return None if self._is_right(self._of_cookie(request)) else Answer(HTTPStatus.FORBIDDEN)

    def _entry(self) -> Answer:
        """The token leaves the address line, and with it history and pictures of the screen."""
        cookie = f'{self._cookie}={self._token}; Path=/; HttpOnly; SameSite=Strict'
        return Answer(HTTPStatus.SEE_OTHER, (('Location', '/'), ('Set-Cookie', cookie)))

    def _of_cookie(self, request: Request) -> str:
        """Others of this host come along, also such as http.cookies refuses: then it would give none of them."""
        pairs = [pair.strip().partition('=') for pair in request.headers.get('cookie', '').split(';')]
        return next((value for name, _, value in pairs if name == self._cookie), '')

    def _is_right(self, given: str) -> bool:
        return hmac.compare_digest(given.encode(), self._token.encode())


class Gate:
    """Listens on ``host`` and ``port`` (0: a free one) from `__init__` to `close`, before the server at ``inner``.

    Raises ConfigurationError.
    """

    def __init__(self, host: str, port: int, inner: tuple[str, int], token: str = '',
                 on_taken: OnTaken = lambda page, update: None):
        check_token(host, token)
        self._inner, self._on_taken = inner, on_taken
        self._loop = asyncio.new_event_loop()
        self._thread = threading.Thread(target=self._loop.run_forever, name='view_gate', daemon=True)
        self._thread.start()
        try:
            self._server = self._call(asyncio.start_server(self._connected, host, port, limit=LARGEST_HEAD))
        except OSError as error:
            self._end()
            raise ConfigurationError(f'{host}:{port}', expected='an address and port that are free', got=str(error),
                                     remedy='Give another --port.') from None
        self.port: int = self._server.sockets[0].getsockname()[1]
        self._rules = Rules(token, self.port)

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
            pass  # the browser has gone, or is none
        finally:
            writer.close()

    async def _answered(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> bool:
        """Take one request; True where another one may follow."""
        head = await asyncio.wait_for(reader.readuntil(b'\r\n\r\n'), HEAD_TIMEOUT)
        request = parsed(head)
        answer = Answer(HTTPStatus.BAD_REQUEST) if request is None else self._rules.answer(request)
        if request is None or answer is not None:
            writer.write((answer or Answer(HTTPStatus.BAD_REQUEST)).as_bytes())
        elif request.receipt is not None:
            self._on_taken(*request.receipt)
            writer.write(RECEIVED)
        else:
            await self._pass_on(head, request.is_websocket, reader, writer)
        await writer.drain()
        return request is not None and answer is None and request.receipt is not None

    async def _pass_on(self, head: bytes, both_ways: bool, reader: asyncio.StreamReader,
                       writer: asyncio.StreamWriter) -> None:
        """Only a WebSocket goes on both ways: a second request on the same connection has not been checked."""
        writer.get_extra_info('socket').setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, SEND_BUFFER)
        inner_reader, inner_writer = await asyncio.open_connection(*self._inner, limit=CHUNK)
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
    """Wait for the one who takes: what is not taken stays where it came from."""
    while data := await reader.read(CHUNK):
        writer.write(data)
        await writer.drain()


async def _closed(server: asyncio.Server) -> None:
    server.close()
    tasks = asyncio.all_tasks() - {asyncio.current_task()}
    for task in tasks:
        task.cancel()
    await asyncio.gather(*tasks, return_exceptions=True)


def _hostname(host: str) -> str:
    try:
        return urlsplit(f'//{host}').hostname or ''
    except ValueError:
        return ''


def _is_url(text: str) -> bool:
    try:
        urlsplit(text)
    except ValueError:
        return False
    return True


