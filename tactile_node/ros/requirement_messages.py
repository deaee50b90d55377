"""What a grasp has to be, from a message, and what it is short of, as one."""

from collections.abc import Collection, Sequence

from builtin_interfaces.msg import Duration

from tactile_node.errors import RefusedRequirementError, RequirementRefusal
from tactile_node.grasp.requirement import MOST_SHAPES, Missing, Requirement
from tactile_node.ros.shape_messages import SHAPE_OF_NUMBER
from tactile_node.ros.time_messages import seconds
from tactile_node.shape.recognition import SHAPES
from tactile_skin.msg import GraspRequirement, RequirementState

NAME_OF_CODE = {code: shape.value for code, shape in SHAPE_OF_NUMBER.items() if shape in SHAPES}
LONGEST = 3600.0  #: s, timeout of a goal; a longer one is taken for a mistake
NANOSECONDS = 10**9


def requirement_of(message: GraspRequirement, known_names: Collection[str] = ()) -> Requirement:
    """Return what ``message`` asks for; ``known_names``: of the classes there are, empty: not known.

    Raises RefusedRequirementError for a limit that is none, and for a shape that no recogniser reports, for which a
    goal would wait in vain.
    """
    if len(message.shapes) + len(message.class_names) > 2 * MOST_SHAPES:  # before anything is made of them
        raise _refused(RequirementRefusal.TOO_MANY_SHAPES, f'at most {MOST_SHAPES} shapes',
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


def timeout_of(message: Duration) -> float:
    """Return the timeout of a goal [s]. Raises RefusedRequirementError for 0, below 0 or longer than LONGEST."""
    timeout = _duration(message, 'timeout')
    if not 0 < timeout <= LONGEST:
        raise _refused(RequirementRefusal.NO_TIMEOUT, f'a timeout above 0 s, at most {LONGEST:g} s', f'{timeout:g} s')
    return timeout


def state_message(found: Sequence[Missing]) -> RequirementState:
    """``found``: as of `missing`."""
    return RequirementState(missing=int(found[0] if found else Missing.NOTHING),
                            all_missing=[int(each) for each in found])


def _name(code: int) -> str:
    if code not in NAME_OF_CODE:
        raise _refused(RequirementRefusal.NO_SUCH_SHAPE, f'codes {", ".join(map(str, NAME_OF_CODE))}', str(code))
    return NAME_OF_CODE[code]


def _duration(message: Duration, name: str) -> float:
    if message.sec < 0 or message.nanosec >= NANOSECONDS:
        raise _refused(RequirementRefusal.NOT_A_LIMIT, 'a duration from 0 s on, with less than 10^9 ns',
                       f'{name} {message.sec} s {message.nanosec} ns')
    return seconds(message)


def _refused(refusal: RequirementRefusal, expected: str, got: str) -> RefusedRequirementError:
    return RefusedRequirementError('requirement of a grasp', refusal, expected=expected, got=got,
                                   remedy='See GraspRequirement.msg.')
