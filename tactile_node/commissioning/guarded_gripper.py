"""Move the gripper only as the person has consented to, and stop it when something unexpected happens."""

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from tactile_node.commissioning.commissioned_gripper import DIRECTIONS, Act, CommissionedGripper, Person, Question
from tactile_node.commissioning.mistake import Mistake, RefusedStepError
from tactile_node.commissioning.movement import NOISES
from tactile_node.commissioning.plan import CommissioningPlan
from tactile_node.commissioning.recording import PadFrames, Recording, joined

TICK = 0.05            #: Period at which the guard looks at the recordings [s].
REACT = 0.005          #: Period while the gripper closes until touched [s].
SILENCE = 0.5          #: Time without joint states or frames after which the gripper or a pad counts as silent [s].
TOUCHED = 0.5          #: Force on a pad that counts as a touch [N].
START_TIME = 1.0       #: Time allowed for a movement to begin [s].
REST_TIME = 0.4        #: Time without a change after which the gripper is at rest [s].
MOVE_LIMIT = 60.0      #: Time allowed for a movement [s].
STILL_SHARE = 0.002    #: A movement by less than this share of the travel does not show that the gripper moves.
ZERO_TIME = 1.0        #: Duration of the recording for a new zero [s].
MOST_DRIFT = 0.03      #: Largest change of a taxel that counts as drift [N].
OUTSIDE = 0.1          #: Share of the travel by which a reading may lie outside the limits of the joint.
SEEN_SHARE = 0.5       #: Share of the taxels of a pad below which the pad counts as silent, because it sends no values.
LEAST_NOISE = 1e-5     #: Noise of a joint whose reading does not change at rest [share of the travel].
HARD_LIMIT = 1.5       #: Share of the force limit above which the guard stops the gripper.


def contact_force(recording: Recording) -> float:
    """Return the largest force on a pad, without taxels whose reading drift explains [N]."""
    return max((float(frame[frame > MOST_DRIFT].sum()) for pad in recording.pads for frame in pad.forces), default=0.0)


class Move(NamedTuple):
    """A command."""

    position: float
    effort: float
    speed: float


class GuardedGripper:
    """A gripper that stops in both ways of stopping when it meets something unexpected.

    Attributes
    ----------
    zero : np.ndarray
        Reading of the untouched taxels, (2, rows, cols) [N]. Recordings are given without it.
    is_faulty : np.ndarray
        Faulty taxels, bool (2, rows, cols). They read 0 N.
    noise : float
        Standard deviation of the joint at rest.
    reading : float
        Latest position of the joint; NaN before the first one.
    """

    def __init__(self, gripper: CommissionedGripper, person: Person, plan: CommissioningPlan):
        self._gripper, self._person, self._plan = gripper, person, plan
        shape = 2, plan.grid.rows, plan.grid.cols
        self.zero, self.is_faulty = np.zeros(shape), np.zeros(shape, bool)
        self.noise = 1e-4 * plan.travel
        self.reading = math.nan
        self._last: Move | None = None
        self._joint_seen, self._pads_seen = -math.inf, [-math.inf, -math.inf]

    def now(self) -> float:
        return self._gripper.now()

    def consent(self, what: str, move: Move, force: float, number: int) -> None:
        """Ask for the consent to a series of movements.

        Raises
        ------
        RefusedStepError
            Raised if the person does not consent.
        """
        movements = '1 movement' if number == 1 else f'{number} movements'
        text = (f'{what}: {movements} at {move.speed:.3g} {self._plan.unit}/s with an effort of {move.effort:.3g}, '
                f'force at most {force:.3g} N. Start?')
        if self._person.ask(Question(Act.CONSENT, text, ('yes', 'no'))) != 'yes':
            raise RefusedStepError(what, Mistake.NO_CONSENT, expected='yes', got='no',
                                   remedy='Start the command again when the gripper may move.')

    def stop(self) -> None:
        """Stop the gripper in both ways of stopping, with the effort of the last command, which is known to suffice."""
        self._gripper.cancel()
        if self._last is not None and math.isfinite(self.reading):
            self.command(self._last._replace(position=self.reading))

    def cancel(self) -> None:
        self._gripper.cancel()

    def command(self, move: Move) -> None:
        """Command a movement to a position within the limits of the joint, because a gripper may reject others."""
        position = min(max(move.position, self._plan.low), self._plan.high)
        self._last = move._replace(position=position)
        self._gripper.command(*self._last)

    def watch(self, seconds: float, where: str, *, may_touch: bool, is_over: Callable[[Recording], bool] | None = None,
              tick: float = TICK) -> Recording:
        """Record for a time, or until ``is_over`` returns True for the newest part of the recording.

        Raises
        ------
        RefusedStepError
            Raised if another client commands the gripper, if joint states or frames stop arriving, if the joint is
            outside its limits, if the force is too high, or if the pads are touched although ``may_touch`` is False.
            The gripper is stopped first.
        """
        parts: list[Recording] = []
        begun = self.now()
        end = begun + seconds
        self._joint_seen = max(self._joint_seen, self.now())
        self._pads_seen = [max(seen, self.now()) for seen in self._pads_seen]
        while not parts or self.now() < end - 1e-9:
            part = self._without_zero(self._gripper.advance(min(tick, max(end - self.now(), 1e-3))))
            parts.append(part)
            if mistake := self._unexpected(part, begun, where, may_touch):
                self.stop()
                raise mistake
            if is_over is not None and is_over(part):
                break
        return joined(parts)

    def move(self, move: Move, where: str, *, may_touch: bool = False) -> Recording:
        """Command a movement, and record until the gripper is at rest.

        Raises
        ------
        RefusedStepError
            Raised as in `watch`, or if the gripper does not move at all. A gripper that had the same target before may
            already be held by an object, and need not move.
        """
        if math.isnan(self.reading):
            self.watch(TICK, where, may_touch=True)
        before, last = self.reading, self._last
        self.command(move)
        has_stalled = last is not None and self._last is not None and last.position == self._last.position
        recording = self.watch(START_TIME, where, may_touch=may_touch)
        end = self.now() + MOVE_LIMIT
        while not self._is_at_rest(recording) and self.now() < end:
            recording = joined((recording, self.watch(REST_TIME / 2, where, may_touch=may_touch)))
        way = abs(move.position - before)
        if not has_stalled and way > 0.01 * self._plan.travel and contact_force(recording) < TOUCHED \
                and abs(self.reading - before) < STILL_SHARE * self._plan.travel:
            raise self.stuck(where)
        return recording

    def stuck(self, where: str) -> RefusedStepError:
        """Ask why the joint states do not change, and return the error."""
        answer = self._person.ask(Question(Act.DIRECTION, 'The joint states do not change. How have the fingers moved?',
                                           DIRECTIONS))
        if answer == 'not moved':
            return RefusedStepError(where, Mistake.EMERGENCY_STOP, expected='a movement', got='none',
                                    remedy='Release the emergency stop, and enable the gripper.')
        return RefusedStepError(where, Mistake.OTHER_JOINT, expected='joint states that follow the fingers',
                                got='a joint at rest', remedy='Give the name of the joint of the gripper.')

    def age_of_frames(self, seconds: float) -> float:
        """Return the largest age of the newest frame of a pad that was received [s], over some time at rest."""
        newest = np.full(2, math.nan)
        oldest = 0.0
        end = self.now() + seconds
        while self.now() < end:
            part = self._gripper.advance(REACT)
            for number, pad in enumerate(part.pads):
                if len(pad.times):
                    newest[number] = pad.times[-1]
            ages = self.now() - newest
            oldest = max(oldest, float(ages.max())) if np.isfinite(ages).all() else oldest
        return oldest

    def measure_noise(self, where: str) -> float:
        """Return the noise of the joint, and keep it as ``noise``."""
        positions = self.watch(1.0, where, may_touch=True).joint.positions
        self.noise = max(float(positions.std(ddof=1)), LEAST_NOISE * self._plan.travel)
        return self.noise

    def renew_zero(self, where: str) -> None:
        """Measure the zero of both pads again, after everything was taken out of the gripper.

        Raises
        ------
        RefusedStepError
            Raised if a taxel has changed by more than drift explains, because something still touches the pads.
        """
        recording = self.watch(ZERO_TIME, where, may_touch=True)
        change = np.array([np.nan_to_num(pad.mean) for pad in recording.pads])
        if np.abs(change).max() > MOST_DRIFT:
            raise RefusedStepError(where, Mistake.HAND_BETWEEN, expected='untouched pads',
                                   got=f'a change of {np.abs(change).max():.2g} N on a taxel',
                                   remedy='Take everything out of the gripper.')
        self.zero = self.zero + change

    def _is_at_rest(self, recording: Recording) -> bool:
        late = recording.after(self.now() - REST_TIME).joint.positions
        return bool(late.size and np.ptp(late) < 2 * NOISES * self.noise)

    def _without_zero(self, recording: Recording) -> Recording:
        left, right = (PadFrames(pad.times, pad.sequences, np.where(faulty, 0.0, pad.forces - zero))
                       for pad, zero, faulty in zip(recording.pads, self.zero, self.is_faulty))
        return Recording((left, right), recording.joint)

    def _unexpected(self, part: Recording, begun: float, where: str, may_touch: bool) -> RefusedStepError | None:
        """Return the reason to stop, or None. Frames from before ``begun`` may show what the person did before."""
        now = self.now()
        if len(part.joint.times):
            self._joint_seen, self.reading = now, float(part.joint.positions[-1])
        for number, pad in enumerate(part.pads):  # the frames of the two pads may arrive in different parts
            if len(pad.times) and np.isfinite(pad.forces[-1]).mean() >= SEEN_SHARE:
                self._pads_seen[number] = now
        if who := self._gripper.others():
            return RefusedStepError(where, Mistake.OTHER_CLIENT, expected='no other client of the gripper', got=who,
                                    remedy='Stop the other node.')
        if now - self._joint_seen > SILENCE:
            return RefusedStepError(where, Mistake.SWITCHED_OFF, expected='joint states of the gripper', got='none',
                                    remedy='Switch the gripper on, and start its driver. If the driver runs, reduce '
                                    'the load of the machine.')
        for number, seen in enumerate(self._pads_seen):
            if now - seen > SILENCE:
                got = 'frames without values' if len(part.pads[number].times) else 'none'
                return RefusedStepError(where, Mistake.PADS_SILENT, got=f'{got} for {now - seen:.2f} s',
                                        expected=f'frames of the pad {self._plan.pads[number]!r}', remedy='Start the '
                                        'driver of the skin. If the driver runs, read its log. On a busy machine, '
                                        'increase the sync_period of the driver.')
        slack = OUTSIDE * self._plan.travel
        if not self._plan.low - slack <= self.reading <= self._plan.high + slack:
            return RefusedStepError(where, Mistake.OTHER_JOINT, got=f'{self.reading:.3g}',
                                    expected=f'a joint between {self._plan.low:g} and {self._plan.high:g}',
                                    remedy='Give the name of the joint of the gripper.')
        limit = HARD_LIMIT * self._plan.force_limit if may_touch else TOUCHED
        force = contact_force(part.after(begun))
        if force > limit:
            return RefusedStepError(where, Mistake.HAND_BETWEEN, expected=f'a force of at most {limit:g} N',
                                    got=f'{force:.2g} N', remedy='Keep your hands out of the gripper.')
        return None
