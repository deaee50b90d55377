"""Give the steps of a commissioning access to the gripper, the person and the record, and share their movements."""

from collections.abc import Callable
from typing import Any, TypeVar

import numpy as np

from tactile_node.commissioning.commissioned_gripper import Act, CommissionedGripper, Person, Question
from tactile_node.commissioning.commissioning_record import CommissioningRecord
from tactile_node.commissioning.evaluation import Evaluation
from tactile_node.commissioning.guarded_gripper import TOUCHED, GuardedGripper, Move
from tactile_node.commissioning.mistake import Mistake, RefusedStepError
from tactile_node.commissioning.movement import StopWay
from tactile_node.commissioning.pad_mounting import taxel_places
from tactile_node.commissioning.plan import CommissioningPlan
from tactile_node.commissioning.recording import Recording
from tactile_node.commissioning.taxel_survey import TaxelFinding

Result = TypeVar('Result')
REPEATS = 3             #: Number of attempts of each part of a step.
FIRST_SHARE = 0.02      #: First movement, as a share of the travel.
MOVING_FACTOR = 1.5     #: Effort of free movements, as a multiple of the smallest one that moves the gripper.
FREE_TIME = 4.0         #: Time in which a free movement covers the whole travel [s].
STOPPED_TIME = 1.2      #: Duration of the recording after a stop [s].
SEEN_TIME = 0.1         #: Duration of the recording that reads the present position [s].
UPPER_ENDS = 'the following numbers are upper limits'  #: Part of the text of a series whose effort rises.

#: End of the request to hold an object.
UNTIL_HELD = '. After you have consented to the movements, keep holding it until the gripper grips it.'


class Session:
    """The gripper, the person and the results of a commissioning, which each step gets.

    Parameters
    ----------
    gripper, person
        The gripper with its pads, and the person beside it.
    plan : CommissioningPlan
        Properties of the gripper from its data sheet, and durations of the steps.
    record : CommissioningRecord
        Results of the finished steps.

    Attributes
    ----------
    gripper : GuardedGripper
        The gripper, which moves only as the person has consented to.
    refused : list of RefusedStepError
        Errors of the parts of steps that were refused.
    order : tuple of int
        Numbers of the left and the right pad in the driver; empty before the step `pads`.
    places : tuple of np.ndarray
        Place of each taxel on the left and the right pad, as in `taxel_places`.
    """

    def __init__(self, gripper: CommissionedGripper, person: Person, plan: CommissioningPlan,
                 record: CommissioningRecord):
        self.gripper = GuardedGripper(gripper, person, plan)
        self.others, self.serial_numbers = gripper.others, gripper.serial_numbers
        self.plan, self.record = plan, record
        self._person = person
        self.refused: list[RefusedStepError] = []
        self.gripper.noise = record['first movement'].get('noise', self.gripper.noise)
        self.order: tuple[int, ...] = ()
        self.places: tuple[np.ndarray, np.ndarray]
        self.recall_pads()

    @property
    def found(self) -> Evaluation:
        """Evaluation of the finished steps."""
        return Evaluation(self.record, self.plan)

    def attempt(self, part: Callable[..., Result], *given: Any) -> Result:
        """Carry out a part of a step with the arguments ``given``, again after each mistake."""
        for attempt in range(REPEATS):
            try:
                return part(*given)
            except RefusedStepError as error:
                self.gripper.stop()
                self.refused.append(error)
                if attempt == REPEATS - 1 or error.mistake is Mistake.NO_CONSENT:
                    raise
                self.ask(Act.REPEAT, str(error))
        raise AssertionError('a part is either carried out or refused')

    def ask(self, act: Act, text: str, choices: tuple[str, ...] = ('done',), *, pad: str = '', place: str = '',
             width: float = 0.0) -> str:
        return self._person.ask(Question(act, text, choices, pad, place, width))

    def recall_pads(self) -> None:
        """Take the zero, the faulty taxels and the mountings from the record."""
        found = self.found
        if found.mountings:
            self.order = (1, 0) if found.is_swapped else (0, 1)
            left, right = (taxel_places(self.plan.grid, each) for each in found.mountings)
            self.places = left, right
            for pad, taxels in zip(self.order, found.taxels):
                self.gripper.is_faulty[pad] = taxels == TaxelFinding.FAULTY
        if found.rests:
            self.gripper.zero = np.array([rest.zero for rest in found.rests])

    def force_of(self, recording: Recording) -> list[np.ndarray]:
        """Return the force on the left and on the right pad in each of their frames [N]."""
        return [np.nansum(recording.pads[pad].forces, axis=(1, 2)) for pad in self.order]

    @property
    def open_end(self) -> float:
        return self.plan.high if self.found.opens_rising else self.plan.low

    @property
    def closed_end(self) -> float:
        return self.plan.low if self.found.opens_rising else self.plan.high

    @property
    def towards(self) -> float:
        """Sign of the change of the reading when the gripper closes."""
        return float(np.sign(self.closed_end - self.open_end))

    def to(self, position: float) -> str:
        """Return the target of a movement for the text of a series."""
        return f' to {position:.3g} {self.plan.unit}'

    def free(self, position: float) -> Move:
        """Return a movement of the empty gripper."""
        effort = min(MOVING_FACTOR * self.record['first movement']['effort'], self.plan.most_effort)
        return Move(position, effort, self.plan.travel / FREE_TIME)

    def closing(self, effort: float) -> Move:
        """Return a movement that closes the gripper with an effort until something holds it."""
        return Move(self.closed_end, effort, self.plan.travel / FREE_TIME)

    def stop_by(self, way: StopWay, move: Move) -> None:
        """Stop the movement ``move`` in one way."""
        if way is StopWay.CANCEL:
            self.gripper.cancel()
        else:
            position = self.gripper.reading if way is StopWay.GOAL else self.open_end
            self.gripper.command(move._replace(position=position))

    def clear(self, where: str) -> None:
        """Open the gripper, and measure the zero again after everything was taken out."""
        if 'first movement' in self.record:  # a gripper that holds an object would snap shut
            self.attempt(self._open, where)
        self.ask(Act.CLEAR, 'Take everything out of the gripper, and keep away from the pads.')
        self.attempt(self.gripper.renew_zero, where)

    def _open(self, where: str) -> None:
        opening = self.free(self.open_end)
        self.gripper.watch(SEEN_TIME, where, may_touch=True)
        if abs(self.gripper.reading - self.open_end) > FIRST_SHARE * self.plan.travel:
            self.gripper.consent(f'opening{self.to(opening.position)} (hold what is between the pads)', opening,
                                  TOUCHED, 1)
        self.gripper.move(opening, where, may_touch=True)

    def insert(self, act: Act, text: str, width: float = 0.0) -> None:
        """Let the person put an object between the pads."""
        self.clear(act.value)
        self.ask(act, text, width=width)
