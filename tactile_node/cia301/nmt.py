"""Network management (CiA 301, 7.2.8): commands of the master, states of the nodes."""

from enum import IntEnum


class NmtCommand(IntEnum):
    """Byte 0 of an NMT command; byte 1 is the node-ID."""

    START = 0x01
    STOP = 0x02
    ENTER_PRE_OPERATIONAL = 0x80
    RESET_NODE = 0x81
    RESET_COMMUNICATION = 0x82


class NmtState(IntEnum):
    """A node's state, as in its heartbeat."""

    BOOT_UP = 0x00
    STOPPED = 0x04
    OPERATIONAL = 0x05
    PRE_OPERATIONAL = 0x7F


def command_name(command: int) -> str:
    """Name an NMT command: 'enter pre-operational'; 'command 0x..' when CiA 301 does not define it."""
    if command not in NmtCommand.__members__.values():
        return f'command 0x{command:02X}'
    return NmtCommand(command).name.lower().replace('_', ' ').replace('pre ', 'pre-')


def state_name(state: int | None) -> str:
    """Name an NMT state as CiA 301 does: 'PRE-OPERATIONAL'; 'never heard' for None."""
    if state is None:
        return 'never heard'
    known = state in NmtState.__members__.values()
    return NmtState(state).name.replace('_', '-') if known else f'unknown NMT state 0x{state:02X}'
