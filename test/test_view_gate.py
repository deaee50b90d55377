"""Who gets data from `tactile view`: requests written by hand, answered by the real server."""

import socket
import urllib.request

import pytest
from viewed import HandSource

from tactile_node.errors import ConfigurationError
from tactile_node.view.gate import Gate, Request, Rules, check_token, is_loopback
from tactile_node.view.server import ViewServer

pytest.importorskip('viser')
pytestmark = pytest.mark.bus
TOKEN = 'abcdefgh-IJKLMNOP_0123'
UPGRADE = ('Upgrade: websocket\r\nConnection: Upgrade\r\nSec-WebSocket-Version: 13\r\n'
           'Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\nSec-WebSocket-Protocol: viser-v0\r\n')


@pytest.fixture(scope='module')
def open_server():
    server = ViewServer(HandSource(), port=0)
    yield server
    server.close()


@pytest.fixture(scope='module')
def guarded():
    """As for another address, but bound to loopback: the rules are those of the token."""
    server = ViewServer(HandSource(), port=0, token=TOKEN)
    yield server
    server.close()


def ask(port, target='/', host=None, more=''):
    """Status and the rest of the answer; target as it goes on the wire."""
    with socket.create_connection(('127.0.0.1', port), 5) as connection:
        host = f'127.0.0.1:{port}' if host is None else host
        connection.sendall(f'GET {target} HTTP/1.1\r\nHost: {host}\r\n{more}\r\n'.encode())
        answer = connection.recv(65536)
    return int(answer.split()[1]), answer


def test_the_page_comes_to_a_browser_of_this_machine(open_server):
    assert ask(open_server.port)[0] == 200


@pytest.mark.parametrize('more', ['', UPGRADE])
def test_another_name_for_this_machine_is_refused(open_server, more):
    """DNS rebinding: a page of evil.example whose name now leads to 127.0.0.1."""
    assert ask(open_server.port, host='evil.example:80', more=more)[0] == 403


def test_a_page_of_another_site_gets_no_websocket(open_server):
    status, _ = ask(open_server.port, more=f'{UPGRADE}Origin: http://evil.example\r\n')
    assert status == 403
    port = open_server.port
    assert ask(port, more=f'{UPGRADE}Origin: http://127.0.0.1:{port}\r\n')[0] == 101


@pytest.mark.parametrize('target, more', [
    ('/', ''), ('/?token=', ''), ('/?token=wrong', ''), (f'/?token={TOKEN}x', ''), (f'/?token={TOKEN[:-1]}', ''),
    ('/', UPGRADE), ('/', 'Cookie: tactile_view_0=' + TOKEN + '\r\n'), ('/taken/0/1', ''),
    (f'/?token=wrong&token={TOKEN}', '')])
def test_without_the_token_nothing_is_given(guarded, target, more):
    status, answer = ask(guarded.port, target, more=more)
    assert status == 403 and b'html' not in answer


def test_the_token_moves_from_the_address_into_a_cookie(guarded):
    status, answer = ask(guarded.port, f'/?token={TOKEN}')
    assert status == 303 and b'Location: /\r\n' in answer and b'HttpOnly; SameSite=Strict' in answer
    cookie = answer.split(b'Set-Cookie: ')[1].split(b';')[0].decode()
    assert ask(guarded.port, more=f'Cookie: {cookie}\r\n')[0] == 200
    assert ask(guarded.port, more=f'Cookie: {cookie}\r\n{UPGRADE}')[0] == 101


def test_a_cookie_of_another_program_of_the_host_does_not_lock_out(guarded):
    cookie = ask(guarded.port, f'/?token={TOKEN}')[1].split(b'Set-Cookie: ')[1].split(b';')[0].decode()
    assert ask(guarded.port, more=f'Cookie: settings={{"a": [1, "b"]}}; {cookie}\r\n')[0] == 200


def test_every_loopback_address_is_this_machine():
    rules = Rules('', 8080)
    assert rules.answer(Request('GET', '/', {'host': '127.0.0.2:8080'})) is None
    assert rules.answer(Request('GET', '/', {'host': '[::1]:8080'})) is None
    for host in ('', '192.168.1.2', '127.0.0.1.evil.example', '[', 'localhost.evil.example:8080'):
        assert rules.answer(Request('GET', '/', {'host': host})).status == 403


def test_web_pages_do_not_find_the_server_behind_the_gate(open_server):
    """viser looks at no Origin: a page of another site may try all ports, of 127.0.0.1 and localhost."""
    with pytest.raises(OSError):
        socket.create_connection(('127.0.0.1', open_server._viser.get_port()), 5).close()


@pytest.mark.parametrize('target, more', [('//[', ''), ('/', f'{UPGRADE}Origin: http://[\r\n')])
def test_an_address_that_is_none_is_answered(open_server, target, more):
    assert ask(open_server.port, target, more=more)[0] == 400


def test_a_second_request_on_one_connection_is_looked_at_too(guarded):
    """The first has the token, the one behind it has not: its bytes never reach the server of the page."""
    cookie = ask(guarded.port, f'/?token={TOKEN}')[1].split(b'Set-Cookie: ')[1].split(b';')[0].decode()
    first = f'GET /taken/0/1 HTTP/1.1\r\nHost: x\r\nCookie: {cookie}\r\n\r\n'
    with socket.create_connection(('127.0.0.1', guarded.port), 5) as connection:
        connection.sendall(f'{first}GET / HTTP/1.1\r\nHost: x\r\n\r\n'.encode())
        answer = b''
        while part := connection.recv(65536):
            answer += part
    assert answer.startswith(b'HTTP/1.1 204') and b'403 Forbidden' in answer and b'html' not in answer


@pytest.mark.parametrize('head', [b'GET /\r\n\r\n', b'\x16\x03\x01\r\n\r\n',
                                  b'POST / HTTP/1.1\r\nHost: localhost\r\n\r\n',
                                  b'GET / HTTP/1.1\r\nHost: localhost\r\nHost: evil\r\n\r\n', b'x' * 40000])
def test_what_is_no_request_of_a_browser_is_refused(open_server, head):
    with socket.create_connection(('127.0.0.1', open_server.port), 5) as connection:
        connection.sendall(head)
        try:
            answer = connection.recv(65536)
        except ConnectionResetError:
            answer = b''
    assert b'200 OK' not in answer and b'html' not in answer


@pytest.mark.parametrize('host', ['0.0.0.0', '192.168.1.2', '::', 'robot.local', ''])
def test_other_addresses_need_a_token(host):
    assert not is_loopback(host)
    with pytest.raises(ConfigurationError):
        check_token(host, '')
    with pytest.raises(ConfigurationError):
        check_token(host, 'short')
    check_token(host, TOKEN)


def test_a_port_that_is_taken_is_reported(open_server):
    with pytest.raises(ConfigurationError):
        Gate('127.0.0.1', open_server.port, ('127.0.0.1', 1))


def test_without_a_browser_the_source_is_off(open_server):
    """Asking for the page is not looking at it."""
    urllib.request.urlopen(f'http://127.0.0.1:{open_server.port}/').read()
    assert open_server._source.begun == 0 and not open_server.is_source_on
