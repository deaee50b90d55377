"""Service data objects (CiA 301, 7.2.4): commands of block uploads and abort codes.

``canopen.sdo.constants`` defines the elementary commands; canopen before 2.4 lacks the abort codes.
"""

from enum import IntEnum

from canopen.sdo.constants import (
    BLOCK_TRANSFER_RESPONSE,
    CRC_SUPPORTED,
    END_BLOCK_TRANSFER,
    INITIATE_BLOCK_TRANSFER,
    REQUEST_BLOCK_DOWNLOAD,
    REQUEST_BLOCK_UPLOAD,
    REQUEST_DOWNLOAD,
    RESPONSE_BLOCK_UPLOAD,
    START_BLOCK_UPLOAD,
)

SDO_BYTES = 8  #: every SDO frame has as many
SEGMENT_BYTES = 7  #: data in one segment
MAX_BLOCK_SEGMENTS = 127
COMMAND = 0xE0  #: mask of the command specifier
BLOCK_COMMAND = 0xE3  #: the same and the sub-command of a block transfer

# Of the client
INITIATE_BLOCK_REQUEST = REQUEST_BLOCK_UPLOAD | INITIATE_BLOCK_TRANSFER
START_BLOCK_REQUEST = REQUEST_BLOCK_UPLOAD | START_BLOCK_UPLOAD
ACKNOWLEDGE_BLOCK_REQUEST = REQUEST_BLOCK_UPLOAD | BLOCK_TRANSFER_RESPONSE
END_BLOCK_REQUEST = REQUEST_BLOCK_UPLOAD | END_BLOCK_TRANSFER
# Of the server
BLOCK_SIZE_GIVEN = 0x02  #: in the answer to INITIATE_BLOCK_REQUEST
INITIATE_BLOCK_RESPONSE = RESPONSE_BLOCK_UPLOAD | INITIATE_BLOCK_TRANSFER | BLOCK_SIZE_GIVEN | CRC_SUPPORTED
END_BLOCK_RESPONSE = RESPONSE_BLOCK_UPLOAD | END_BLOCK_TRANSFER


class AbortCode(IntEnum):
    """Why a server refuses a request; those that this package uses."""

    INVALID_BLOCK_SIZE = 0x0504_0002
    NOT_MAPPABLE = 0x0604_0041
    PDO_TOO_LONG = 0x0604_0042
    INVALID_VALUE = 0x0609_0030
    WRONG_DEVICE_STATE = 0x0800_0022


def written_object(request: bytes) -> int | None:
    """Return the index that an SDO client begins to write; None for any other request.

    >>> hex(written_object(bytes.fromhex('2F001A0000000000')))
    '0x1a00'
    >>> written_object(bytes.fromhex('40001A0000000000'))  # an upload
    """
    if len(request) != SDO_BYTES:
        return None
    command = request[0]
    is_block = command & COMMAND == REQUEST_BLOCK_DOWNLOAD and not command & END_BLOCK_TRANSFER
    return int.from_bytes(request[1:3], 'little') if is_block or command & COMMAND == REQUEST_DOWNLOAD else None
