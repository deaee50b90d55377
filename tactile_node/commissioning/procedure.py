"""Lead a person through the commissioning of a gripper with two pads, step by step.

Each step asks the person for something, moves the gripper with the person's consent, and stores its results. A mistake
stops the gripper, is explained, and repeats only the part in which the mistake was made. The procedure reads no clock
and knows no ROS: it talks to a `CommissionedGripper` and a `Person`.
"""

from collections.abc import Callable, Collection
from functools import partial
from typing import Any, NamedTuple

from tactile_node.commissioning.commissioned_gripper import Act, CommissionedGripper, Person
from tactile_node.commissioning.commissioning_record import CommissioningRecord
from tactile_node.commissioning.force_steps import hang_weight, press_block, press_foam, press_jig, prove_parameters
from tactile_node.commissioning.mistake import Mistake, RefusedStepError
from tactile_node.commissioning.movement_steps import find_step, move_first, try_stops
from tactile_node.commissioning.pad_steps import find_pads, watch_untouched_pads
from tactile_node.commissioning.plan import CommissioningPlan
from tactile_node.commissioning.session import Session

PAD_STEPS = 'rest', 'pads'  #: Steps that find the zero, the faulty taxels and the mountings of the pads.
RATE_TIME = 2.0         #: Time over which the rate of the frames is compared with the record [s].
MOST_RATE_CHANGE = 0.1  #: Largest relative difference of the two rates.


class CommissioningStep(NamedTuple):
    """A step of a commissioning.

    The results are a dict. A step that has found nothing returns only a ``reason``.
    """

    kind: str  #: name of the step; a block adds its width
    #: function of a `Session` (and of a block) that carries out the step, and returns the results
    measure: Callable[..., dict[str, Any]]
    is_optional: bool = False
    needs: tuple[str, ...] = ()  #: kinds of the steps whose results the step needs


STEPS = (
    CommissioningStep('rest', watch_untouched_pads),
    CommissioningStep('pads', find_pads),
    CommissioningStep('first movement', move_first),
    CommissioningStep('stops', try_stops),
    CommissioningStep('foam', press_foam, is_optional=True),
    CommissioningStep('block', press_block, is_optional=True, needs=('foam',)),  # once for each block
    CommissioningStep('jig', press_jig, is_optional=True, needs=('foam', 'block')),
    CommissioningStep('step', find_step, is_optional=True),
    CommissioningStep('weight', hang_weight, is_optional=True, needs=('foam',)),
    CommissioningStep('proof', prove_parameters, is_optional=True, needs=('foam', 'block')))
OPTIONAL = tuple(step.kind for step in STEPS if step.is_optional)  #: Kinds of the steps that may be left out.


class CommissioningProcedure:
    """The steps of a commissioning.

    Parameters
    ----------
    gripper, person, plan, record
        See `Session`. The steps that the record contains are not repeated.
    on_step : callable
        Function that is called with the name of each step before the step begins.
    on_result : callable
        Function that is called with the name of each step after the step, and with the reason if the step has found
        nothing, or ''.
    """

    def __init__(self, gripper: CommissionedGripper, person: Person, plan: CommissioningPlan,
                 record: CommissioningRecord, on_step: Callable[[str], None] = lambda name: None,
                 on_result: Callable[[str, str], None] = lambda name, reason: None):
        self._session, self._record = Session(gripper, person, plan, record), record
        self.refused = self._session.refused  #: errors of the parts of steps that were refused
        self._on_step, self._on_result = on_step, on_result
        self.steps: dict[str, CommissioningStep] = {}  #: the steps of the plan by name, in their order
        for step in STEPS:
            if step.kind == 'block':
                for block in plan.blocks:
                    name = f'block {1e3 * block.width:g} mm'
                    self.steps[name] = step._replace(measure=partial(press_block, block=block))
            elif step.kind != 'jig' or plan.jig:
                self.steps[step.kind] = step

    def run(self, skip: Collection[str] = ()) -> None:
        """Carry out all steps that are not finished.

        Parameters
        ----------
        skip : collection of str
            Steps of OPTIONAL to leave out. A step that needs one of them is left out as well.

        Raises
        ------
        RefusedStepError
            Raised if a part of a step was refused REPEATS times. The results of the finished steps are kept.
        """
        if who := self._session.others():
            raise RefusedStepError('gripper', Mistake.OTHER_CLIENT, expected='no other client of the gripper', got=who,
                                   remedy='Stop touch_gripper and all other clients first.')
        if self._session.ask(Act.CONFIRM_STOP, 'The gripper will move. Is the emergency stop in your reach?',
                             ('yes', 'no')) != 'yes':
            raise RefusedStepError('gripper', Mistake.NO_CONSENT, expected='an emergency stop in reach', got='no',
                                   remedy='Put the emergency stop within your reach.')
        try:
            if 'rest' in self._record:
                self._session.attempt(_check_rates, self._session)
            for name, step in self.steps.items():
                if name not in self._record and step.kind not in skip and self._has_finished(step.needs):
                    self._on_step(name)
                    results = step.measure(self._session)
                    if is_found := bool(results.keys() - {'reason'}):
                        self._record.save(name, results)
                    if step.kind in PAD_STEPS:
                        self._session.recall_pads()
                    self._on_result(name, '' if is_found else results['reason'])
        except BaseException:  # Ctrl-C stops the gripper as well
            self._session.gripper.stop()
            raise

    def unfinished(self, skip: Collection[str] = ()) -> list[str]:
        """Return the steps without results, except those that are skipped or that need a skipped step."""
        return [name for name, step in self.steps.items()
                if name not in self._record and not {step.kind, *step.needs} & set(skip)]

    def _has_finished(self, kinds: Collection[str]) -> bool:
        return all(name in self._record for name, step in self.steps.items() if step.kind in kinds)


def _check_rates(session: Session) -> None:
    """Refuse to continue a record if the driver sends frames at another rate, on which the latencies depend."""
    recording = session.gripper.watch(RATE_TIME, 'rest', may_touch=True)
    for name, pad, rest in zip(session.plan.pads, recording.pads, session.found.rests):
        if abs(pad.rate / rest.rate - 1) > MOST_RATE_CHANGE:
            raise RefusedStepError(f'pad {name!r}', Mistake.OTHER_RATE, got=f'{pad.rate:.1f}',
                                   expected=f'{rest.rate:.1f} frames per second, as in the record',
                                   remedy='Start the driver with the settings of the record, or begin again in '
                                   'another folder.')
