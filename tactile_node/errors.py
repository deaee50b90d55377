"""Define the errors that this package raises.

Every message states the expected value, the actual value and a remedy.
"""

from enum import IntEnum


class TactileError(Exception):
    """Base class of all errors of this package.

    An error of this kind means that an input, a device or a bus cannot be used.

    Parameters
    ----------
    where : str
        Place of the error: a file and key, a parameter, a node or a bus.
    expected : str
        What was expected at this place.
    got : str
        What was found at this place.
    remedy : str
        What the user can do about the error.

    Examples
    --------
    >>> print(ConfigurationError('layout.yaml, key "rows"', expected='a whole number >= 1',
    ...                          got="'many'", remedy='Write the number of taxel rows.'))
    layout.yaml, key "rows": expected a whole number >= 1, got 'many'. Write the number of taxel rows.
    """

    def __init__(self, where: str, *, expected: str, got: str, remedy: str):
        super().__init__(f'{where}: expected {expected}, got {got}. {remedy}')
        self.where = where
        self.expected = expected
        self.got = got
        self.remedy = remedy


class ConfigurationError(TactileError):
    """A configuration is wrong, for example an EDS, a skin layout, a YAML file, a parameter or a launch argument."""


class BusError(TactileError):
    """The CAN bus cannot be opened or used."""


class InterruptedSetupError(BusError):
    """The driver was stopped while it was configuring a device."""


class DeviceError(TactileError):
    """The CANopen device is absent, is not the expected device, or rejects a request."""


class DeviceAbsentError(DeviceError):
    """The CANopen device does not answer."""


class UnverifiedDeviceError(DeviceError):
    """The CANopen device, or the mapping of one of its TPDOs, differs from the EDS and the layout."""


class TwoDevicesError(DeviceError):
    """Two CANopen devices answer with the same node-ID."""


class HalfZeroedError(DeviceError):
    """Some channels of a pad have zeroed themselves, but other channels have not, or might not have."""


class TareRefusal(IntEnum):
    """Reason why a tare was refused. The code numbers never change."""

    NOT_KNOWN = 0
    PRESSED = 1          #: a taxel reads ``tare_limit`` or more
    NO_VALID_VALUES = 2  #: no taxel of the pad has a valid value
    TOO_FEW_FRAMES = 3   #: the frames to be averaged did not arrive in time
    DRIVER_NOT_ACTIVE = 4
    BUSY = 5             #: another request is in progress
    TOO_MANY_FRAMES = 6  #: the request would take too long
    CONTACT = 7          #: a contact is present, although its readings are below the parameter tare_limit


class TareRefusedError(TactileError):
    """A pad cannot be tared now. The attribute ``refusal`` gives the reason."""

    def __init__(self, where: str, refusal: TareRefusal, *, expected: str, got: str, remedy: str):
        super().__init__(where, expected=expected, got=got, remedy=remedy)
        self.refusal = refusal


class RequirementRefusal(IntEnum):
    """Reason for refusing a requirement on a grasp, or a goal with such a requirement.

    CheckGrasp.srv uses the same numbers.
    """

    NOT_KNOWN = 0
    NOT_REFUSED = 1
    NOT_A_LIMIT = 2  #: a value is NaN, infinite or below 0, a confidence is above 1, or a duration is invalid
    NO_SUCH_SHAPE = 3
    TOO_MANY_SHAPES = 4
    EMPTY_RANGE = 5
    NO_TIMEOUT = 6      #: the goal has no timeout
    TOO_MANY_GOALS = 7  #: too many goals are already waiting


class RefusedRequirementError(TactileError):
    """A requirement on a grasp cannot be used. The attribute ``refusal`` gives the reason."""

    def __init__(self, where: str, refusal: RequirementRefusal, *, expected: str, got: str, remedy: str):
        super().__init__(where, expected=expected, got=got, remedy=remedy)
        self.refusal = refusal


class RefusedGoalError(TactileError):
    """A goal sent to the gripper cannot be used."""


class LogError(TactileError):
    """A recorded CAN log is missing, unreadable or truncated."""


class InputError(TactileError):
    """An array of taxels or a pattern has a shape or type that cannot be processed."""
