"""Devices that respond slowly, and an SDO server that also serves another master."""

import threading
import time
from collections import Counter
from contextlib import suppress

import numpy as np
import pytest
from can_bench import INTERFACE, Bench, other_bus
from canopen import SdoAbortedError, SdoCommunicationError
from waiting import wait_until

from tactile_node.assembly.health import NodeFault
from tactile_node.bus import bus_devices
from tactile_node.bus.device_setup import DeviceSetup
from tactile_node.bus.own_sdo import OwnSdoClient
from tactile_node.errors import BusError, DeviceAbsentError, TwoDevicesError
from tactile_node.simulator.skin_simulator import SkinSimulator
from tactile_node.skin.eds import load_eds

pytestmark = pytest.mark.bus

SDO_ANSWER = 0x5A0


def delay_answers(device, seconds):
    """Delay each SDO response of ``device`` by ``seconds``."""
    send = device._network.send_message

    def late(can_id, data, *rest, **more):
        if can_id != SDO_ANSWER:
            return send(can_id, data, *rest, **more)
        threading.Timer(seconds, answer, (can_id, bytes(data))).start()

    def answer(can_id, data):
        with suppress(BusError):  # The bus may already be closed at this time.
            send(can_id, data)
    device._network.send_message = late


@pytest.mark.parametrize('delay', [0.12, *(pytest.param(each, marks=pytest.mark.long) for each in (0.05, 0.2))])
def test_a_device_that_answers_after_the_timeout_is_configured(delay):
    """An earlier version mistook a late response for the response to the next request, and refused the device."""
    retries = 12  # 12 retries cover 1 s in total, because a busy machine adds to the delay.
    with Bench(f'late {delay}', layout='rows12x5_10bit.yaml', sdo_timeout=0.08, sdo_retries=retries) as bench:
        bench.driver.open()
        delay_answers(bench.simulator.devices[32], delay)
        bench.driver.configure()


def test_two_devices_whose_answers_are_mixed_up_are_reported_as_two(monkeypatch):
    """If the second device answers late, a value read back may be an answer to an earlier request.

    In an earlier version, the driver then reported that the device does not accept the value.
    """
    with Bench('mixed answers') as bench:
        second = SkinSimulator(bench.pads, {'pad32': lambda t: np.zeros((16, 16))})
        second.start(INTERFACE, bench.channel)
        bench.driver.open()

        def mixed_up(setup, *_):
            wait_until(lambda: 2 * setup._sdo.doubled > setup._sdo.requests)
            setup._refuse_other_value('0x1800 sub 1', '0x000001A0', '0x800001A0')
        monkeypatch.setattr(DeviceSetup, '_verify', mixed_up)
        with pytest.raises(TwoDevicesError, match='node 32'):
            bench.driver.configure()
        second.stop()


def test_a_server_that_is_silent_during_the_configuration_is_waited_for():
    """In an earlier version, an SDO server that stayed silent during the configuration ended the process.

    The driver must wait for a device that is absent at start.
    """
    with Bench('silent server', sdo_timeout=0.05, sdo_retries=1) as bench:
        bench.driver.open()
        device = bench.simulator.devices[32]
        send, answered = device._network.send_message, []

        def falls_silent(can_id, data, *rest, **more):
            answered.append(can_id == SDO_ANSWER)
            if can_id != SDO_ANSWER or sum(answered) < 30:
                send(can_id, data, *rest, **more)
        device._network.send_message = falls_silent
        with pytest.raises(DeviceAbsentError, match='sdo_timeout'):
            bench.driver.configure()
        device._network.send_message = send
        bench.driver.configure()


def test_a_driver_closes_while_it_configures_a_slow_device():
    """Each response takes a third of a second, and the configuration needs a hundred responses.

    When closing, the driver waits for one pending response, not for all hundred.
    """
    with Bench('slow close', sdo_timeout=1.0) as bench:
        bench.supervise()
        bench.run()
        bench.take_whole(1)
        device = bench.simulator.devices[32]
        delay_answers(device, 0.3)
        device.power_off()
        device.boot()
        assert wait_until(lambda: bench.driver.facts().pad('pad32').nodes[0].fault is NodeFault.BOOTED)
        with other_bus('slow close') as other:
            def requests() -> int:
                return sum(message.arbitration_id == 0x620 for message in iter(lambda: other.recv(0), None))
            assert wait_until(lambda: requests() > 0)
            bench.driver.close()
            assert requests() <= 2


def test_the_driver_waits_for_a_device_that_starts_late(monkeypatch):
    """The device starts later than START_PERIOD and three heartbeat times of 0.1 s, and within ``boot_timeout``."""
    monkeypatch.setattr(bus_devices, 'START_PERIOD', 0.1)
    with Bench('late start', boot_timeout=20.0) as bench:
        bench.driver.open()
        bench.driver.configure()
        device = bench.simulator.devices[32]
        device.refuses_start = True
        threading.Timer(0.6, setattr, (device, 'refuses_start', False)).start()
        bench.driver.start()
        assert device.operational


class Wire:
    """Records the requests of a client, and sends ``answers`` after each request."""

    def __init__(self, *answers):
        self.requests, self.client, self._answers = [], None, answers

    def send_message(self, can_id, data):
        self.requests.append(bytes(data))
        for answer in self._answers:
            self.client.on_response(SDO_ANSWER, bytearray.fromhex(answer), 0.0)


def client_on(wire, timeout, owed=None):
    wire.client = client = OwnSdoClient(32, load_eds('sim16x16.eds', 32), timeout, Counter() if owed is None else owed)
    client.network = wire
    return client


@pytest.mark.parametrize('others', [
    [], ['4308100041424344'], ['4308100041424344', '8018100200000206', '6000180100000000']],
    ids=['none', 'one', 'an abort and a confirmation, too'])
def test_the_answer_about_our_object_is_taken(others):
    wire = Wire(*others, '43181001C1050000')
    client = client_on(wire, 1.0)
    assert client.upload(0x1018, 1) == bytes.fromhex('C1050000')
    assert client.others == len(others) and len(wire.requests) == 1


def test_a_delayed_device_may_answer_requests_of_earlier_clients():
    """The device sends three responses to three requests.

    In an earlier version, the driver mistook three responses for those of two devices.
    """
    answer, owed = '43181001C1050000', Counter()
    for _ in range(2):
        with pytest.raises(SdoCommunicationError):
            client_on(Wire(), 0.01, owed).upload(0x1018, 1)
    held_up = client_on(Wire(*[answer] * 3), 1.0, owed)
    held_up.upload(0x1018, 1)
    assert held_up.doubled == 0
    two_devices = client_on(Wire(*[answer] * 2), 1.0, owed)
    two_devices.upload(0x1018, 1)
    assert two_devices.doubled == 1


def test_an_abort_without_an_object_is_ours():
    client = client_on(Wire('8000000000000206'), 5.0)
    with pytest.raises(SdoAbortedError):
        client.upload(0x1018, 1)


def test_answers_about_other_objects_are_ignored():
    """In an earlier version, a response about another object ended the wait.

    In an earlier version, the client then repeated its request at once, 2,700 times a second.
    """
    wire = Wire(*['4308100041424344'] * 20)
    client = client_on(wire, 0.2)
    begin = time.monotonic()
    with pytest.raises(SdoCommunicationError):
        client.upload(0x1018, 1)
    assert time.monotonic() - begin >= 0.2 and len(wire.requests) == 2  # The two frames are the request and its abort.
    assert client.RESPONSE_TIMEOUT == 0.2
