"""Access to the data of `tactile view`: the test sends hand-written requests to a real server."""

import socket
import urllib.request
from types import SimpleNamespace

import pytest
from viewed import HandSource
from waiting import until

from tactile_node.errors import ConfigurationError
from tactile_node.viewing.gate import Gate, Request, check_request
from tactile_node.viewing.server import ViewServer

pytest.importorskip('viser')
pytestmark = pytest.mark.bus
UPGRADE = ('Upgrade: websocket\r\nConnection: Upgrade\r\nSec-WebSocket-Version: 13\r\n'
           'Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\nSec-WebSocket-Protocol: viser-v0\r\n')


@pytest.fixture(scope='module')
def open_server():
    server = ViewServer(HandSource(), port=0)
    yield server
    server.close()


def ask(port, target='/', host=None, more=''):
    """Return the status and the complete response to a request, with ``target`` sent unchanged."""
    with socket.create_connection(('127.0.0.1', port), 5) as connection:
        host = f'127.0.0.1:{port}' if host is None else host
        connection.sendall(f'GET {target} HTTP/1.1\r\nHost: {host}\r\n{more}\r\n'.encode())
        answer = connection.recv(65536)
    return int(answer.split()[1]), answer


def test_the_page_comes_to_a_browser_of_this_machine(open_server):
    assert ask(open_server.port)[0] == 200


@pytest.mark.parametrize('more', ['', UPGRADE])
def test_another_name_for_this_machine_is_refused(open_server, more):
    """In a DNS rebinding attack, evil.example first resolves to the attacker's server and later to 127.0.0.1."""
    assert ask(open_server.port, host='evil.example:80', more=more)[0] == 403


def test_a_page_of_another_site_gets_no_websocket(open_server):
    status, _ = ask(open_server.port, more=f'{UPGRADE}Origin: http://evil.example\r\n')
    assert status == 403
    port = open_server.port
    assert ask(port, more=f'{UPGRADE}Origin: http://127.0.0.1:{port}\r\n')[0] == 101


def test_every_loopback_address_is_this_machine():
    assert check_request(Request('GET', '/', {'host': '127.0.0.2:8080'})) is None
    assert check_request(Request('GET', '/', {'host': '[::1]:8080'})) is None
    for host in ('', '192.168.1.2', '127.0.0.1.evil.example', '[', 'localhost.evil.example:8080'):
        assert check_request(Request('GET', '/', {'host': host})) == 403


def test_web_pages_do_not_find_the_server_behind_the_gate(open_server):
    """The viser server does not check the Origin header.

    A page from another site may try all ports of 127.0.0.1 and localhost.
    """
    with pytest.raises(OSError):
        socket.create_connection(('127.0.0.1', open_server._viser.get_port()), 5).close()


@pytest.mark.parametrize('target, more', [('//[', ''), ('/', f'{UPGRADE}Origin: http://[\r\n')])
def test_an_unknown_address_gets_an_answer(open_server, target, more):
    assert ask(open_server.port, target, more=more)[0] == 400


def test_a_second_request_on_one_connection_is_checked_too(open_server):
    """The first request names this machine as its host, but the second request does not.

    The bytes of the second request must never reach the server of the page.
    """
    first = 'GET /taken/0/1 HTTP/1.1\r\nHost: localhost\r\n\r\n'
    with socket.create_connection(('127.0.0.1', open_server.port), 5) as connection:
        connection.sendall(f'{first}GET / HTTP/1.1\r\nHost: evil.example\r\n\r\n'.encode())
        answer = b''
        while part := connection.recv(65536):
            answer += part
    assert answer.startswith(b'HTTP/1.1 204') and b'403 Forbidden' in answer and b'html' not in answer


@pytest.mark.parametrize('head', [b'GET /\r\n\r\n', b'\x16\x03\x01\r\n\r\n',
                                  b'POST / HTTP/1.1\r\nHost: localhost\r\n\r\n',
                                  b'GET / HTTP/1.1\r\nHost: localhost\r\nHost: evil\r\n\r\n', b'x' * 40000])
def test_data_that_is_not_a_browsers_request_is_refused(open_server, head):
    with socket.create_connection(('127.0.0.1', open_server.port), 5) as connection:
        connection.sendall(head)
        try:
            answer = connection.recv(65536)
        except ConnectionResetError:
            answer = b''
    assert b'200 OK' not in answer and b'html' not in answer


def test_other_machines_do_not_reach_the_page(open_server):
    assert [each.getsockname()[0] for each in open_server._gate._server.sockets] == ['127.0.0.1']


def test_a_port_that_is_taken_is_reported(open_server):
    with pytest.raises(ConfigurationError):
        Gate(open_server.port, ('127.0.0.1', 1))


def test_a_source_that_cannot_start_is_reported_on_the_page(caplog):
    class Broken(HandSource):
        def start(self):
            super().start()
            raise RuntimeError('a defect')
    server = ViewServer(Broken(), port=0)
    with server._changed:
        # This object stands in for a connected browser.
        server._pages[0] = SimpleNamespace(stop=lambda: None, join=lambda: None)
        server._changed.notify_all()
    until(lambda: server.is_source_on, 60)
    assert server._source.store.shown().problem == 'internal error: RuntimeError: a defect'
    assert 'Traceback' in caplog.text
    server.close()  # Closing the server also ends its thread.
    assert (server._source.begun, server._source.ended) == (1, 1)


def test_without_a_browser_the_source_is_off(open_server):
    """A request for the page alone does not start the source."""
    urllib.request.urlopen(f'http://127.0.0.1:{open_server.port}/').read()
    assert open_server._source.begun == 0 and not open_server.is_source_on
