"""Read the requirement that a grasp must meet from a message, and convert unmet conditions to a message."""

from collections.abc import Collection, Sequence

from builtin_interfaces.msg import Duration

from tactile_node.errors import RefusedRequirementError, RequirementRefusal
from tactile_node.grasp.requirement import MOST_REQUIRED, Missing, Requirement
from tactile_node.ros.shape_messages import NAME_OF_NUMBER
from tactile_node.ros.time_messages import seconds
from tactile_node.shape.recognition import SHAPES
from tactile_skin.msg import GraspRequirement, RequirementState

#: code -> name of each shape that a requirement may list
REQUIRABLE = {code: name for code, name in NAME_OF_NUMBER.items() if name in SHAPES}
LONGEST = 3600.0  #: longest timeout of a goal [s]. A longer timeout is probably a mistake, and is refused.
NANOSECONDS = 10**9


def requirement_of(message: GraspRequirement, known_names: Collection[str] = ()) -> Requirement:
    """Return the requirement in a message.

    Parameters
    ----------
    message
        Requirement message.
    known_names
        Names of the existing classes, or empty if the classes are not known.

    Raises
    ------
    RefusedRequirementError
        Raised if a limit is invalid, or if no recogniser reports a required shape, so that no grasp could ever meet the
        requirement.
    """
    if len(message.shapes) + len(message.class_names) > 2 * MOST_REQUIRED:  # this check precedes the work on the names
        raise _refused(RequirementRefusal.TOO_MANY_SHAPES, f'at most {MOST_REQUIRED} shapes',
                       f'{len(message.shapes)} codes and {len(message.class_names)} names')
    shapes = frozenset((*map(_name, message.shapes), *message.class_names))
    requirement = Requirement(
        shapes=shapes, min_confidence=message.min_confidence, min_held=_duration(message.min_held, 'min_held'),
        min_width=message.min_width, max_width=message.max_width, max_offset=message.max_offset,
        max_misalignment=message.max_misalignment, accepts_bound=message.accept_bound)
    if known_names and not shapes <= set(known_names):
        raise _refused(RequirementRefusal.NO_SUCH_SHAPE, f'names of {", ".join(known_names)}',
                       ', '.join(sorted(shapes - set(known_names))))
    return requirement


def timeout_of(message: Duration, longest: float = LONGEST) -> float:
    """Return the timeout of a goal [s]. Raises RefusedRequirementError unless the timeout is in (0, ``longest``]."""
    timeout = _duration(message, 'timeout')
    if not 0 < timeout <= longest:
        raise _refused(RequirementRefusal.NO_TIMEOUT, f'a timeout above 0 s, at most {longest:g} s', f'{timeout:g} s')
    return timeout


def state_message(found: Sequence[Missing]) -> RequirementState:
    """Return the unmet conditions found by `missing` as a message."""
    return RequirementState(missing=int(found[0] if found else Missing.NOTHING),
                            all_missing=[int(each) for each in found])


def _name(code: int) -> str:
    if code not in REQUIRABLE:
        raise _refused(RequirementRefusal.NO_SUCH_SHAPE, f'codes {", ".join(map(str, REQUIRABLE))}', str(code))
    return REQUIRABLE[code]


def _duration(message: Duration, name: str) -> float:
    if message.sec < 0 or message.nanosec >= NANOSECONDS:
        raise _refused(RequirementRefusal.NOT_A_LIMIT, 'a duration of 0 s or more, with less than 10^9 ns',
                       f'{name} {message.sec} s {message.nanosec} ns')
    return seconds(message)


def _refused(refusal: RequirementRefusal, expected: str, got: str) -> RefusedRequirementError:
    return RefusedRequirementError('requirement of a grasp', refusal, expected=expected, got=got,
                                   remedy='See GraspRequirement.msg.')
