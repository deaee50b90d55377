"""Commission simulated grippers with random properties on a virtual clock, and compare the results with the truth.

    python bench/bench_commissioning.py [--grippers 50] [--seed 1] [--results FILE]

Seeds for the tuning of the estimators begin at 1000, and seeds for the report at 1. With --results, each gripper is
added to a file, and a later run continues after the last gripper in the file.
"""

import argparse
import json
import math
import sys
import tempfile
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

import numpy as np
from commissioning_world import ALIGNED, FACES, GRID, CommissioningDesk, Truth, random_truth
from scipy.spatial.transform import Rotation

from tactile_node.commissioning.commissioning_record import CommissioningRecord
from tactile_node.commissioning.evaluation import KEPT_SHARE, Evaluation
from tactile_node.commissioning.jig import PadPlace
from tactile_node.commissioning.measurement import Estimate
from tactile_node.commissioning.mistake import RefusedStepError
from tactile_node.commissioning.movement import StopWay
from tactile_node.commissioning.pad_alignment import PadAlignment
from tactile_node.commissioning.plan import CommissioningPlan, GaugeBlock
from tactile_node.commissioning.procedure import CommissioningProcedure
from tactile_node.commissioning.report_lines import Verdict, fits_closing
from tactile_node.commissioning.taxel_survey import TaxelFinding

WEIGHT = 5.0  #: [N]


def plan_for(truth: Truth, **changes: Any) -> CommissioningPlan:
    """Return the plan that a person writes who has the data sheet of the gripper."""
    blocks = tuple(GaugeBlock(width, length) for width, length in FACES.items())
    return CommissioningPlan(GRID, 'finger_joint', truth.unit, truth.low, truth.high, truth.most_effort, blocks,
                             WEIGHT, **changes)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('--grippers', type=int, default=50)
    parser.add_argument('--seed', type=int, default=1, help='seed of the first gripper')
    parser.add_argument('--results', type=Path, help='file with one line for each gripper')
    args = parser.parse_args()
    done = [json.loads(line) for line in args.results.read_text().splitlines()] \
        if args.results and args.results.exists() else []
    for number in range(len(done), args.grippers):
        done.append(commissioned(args.seed + number))
        if args.results:
            with args.results.open('a') as file:
                file.write(json.dumps(done[-1], default=lambda value: value.item()) + '\n')
    print_bars(done)
    return 0


def commissioned(seed: int) -> dict[str, Any]:
    """Commission one gripper, and return each result beside the truth."""
    rng = np.random.default_rng(seed)
    truth = random_truth(rng)
    desk = CommissioningDesk(truth, rng)
    plan = plan_for(truth, jig=desk.jig)
    with tempfile.TemporaryDirectory() as folder:
        record = CommissioningRecord(Path(folder) / 'record.json')
        procedure = CommissioningProcedure(desk, desk, plan, record)
        try:
            procedure.run()
            end = ''
        except RefusedStepError as error:
            end = str(error)
        return compared(truth, Evaluation(record, plan), record) | {
            'seed': seed, 'end': end, 'refused': [str(error) for error in procedure.refused]}


def compared(truth: Truth, found: Evaluation, record: CommissioningRecord) -> dict[str, Any]:
    """Return discrete facts, bounds, poses and values with the truth."""
    facts: dict[str, tuple[Any, Any]] = {'swapped': (found.is_swapped, truth.is_swapped)}
    for pad in range(2):
        mounting = found.mountings[pad] if found.mountings else (None, None)
        facts[f'turn {pad}'] = mounting[0], truth.mounts[pad][0]
        facts[f'mirrored {pad}'] = mounting[1], truth.mounts[pad][1]
        faulty = sorted(map(list, np.argwhere(found.taxels[pad] == TaxelFinding.FAULTY).tolist())) \
            if found.taxels else None
        facts[f'faulty {pad}'] = faulty, sorted(map(list, truth.faulty[pad]))
    for way in StopWay:
        tried = found.tried(way)
        facts[f'stop by {way.value}'] = tried.is_reliable if tried.trials else None, way is not truth.failing
    kept = found.tried(StopWay.CANCEL).kept
    facts['lets go'] = bool(kept.value < KEPT_SHARE) if kept.is_known else None, \
        truth.lets_go if truth.failing is not StopWay.CANCEL else bool(kept.value < KEPT_SHARE)
    closing = fits_closing(found)
    usable = truth.failing is not StopWay.GOAL or not truth.lets_go
    facts['fit'] = None if closing.verdict is Verdict.UNKNOWN else closing.verdict is Verdict.PASS, \
        usable and truth.step * abs(truth.slope(found.law.middle if found.law else truth.low)) * truth.stiffness \
        * _longest_face() <= 20.0
    latencies = {'start': (found.start_latency, truth.latency + truth.jitter)}
    for way in (StopWay.CANCEL, StopWay.GOAL):
        latencies[way.value] = found.stop_latency(way), truth.latency + truth.jitter + truth.braking
    return {'facts': facts, 'latencies': latencies, **_values(truth, found, record)}


def _longest_face() -> float:
    """Return the stiffness of the block with the longest face, as a share of the stiffness of the truth."""
    return max(FACES.values()) / 0.018


def _values(truth: Truth, found: Evaluation, record: CommissioningRecord) -> dict[str, Any]:
    law, values, poses = found.law, {}, {}
    for pad, of in enumerate(record['rest'].get('pads', [])):
        physical = 1 - pad if truth.is_swapped else pad
        values[f'noise {pad}'] = *of['noise'], truth.noise
        values[f'drift {pad}'] = *of['drift'], truth.drift[physical]
    result: dict[str, Any] = {}
    if law:
        readings = np.linspace(*law.readings, 11)
        errors = [law.opening(each).value - truth.gap(each) for each in readings]
        slopes = [law.slope(each).value / truth.slope(each) - 1 for each in readings]
        result['law'] = float(np.abs(errors).max()), float(np.abs(slopes).max())
        middle = law.middle
        values['opening'] = *law.opening(middle), truth.gap(middle)
        values['scale'] = *law.slope(middle), truth.slope(middle)
        values['speed'] = *found.speed, truth.span / 4 * truth.speed_factor * abs(truth.slope(middle))
        if found.step.is_known:
            values['step'] = *found.step, truth.step * abs(truth.slope(record['step']['at']))
        values['stiffness'] = *found.stiffness, truth.stiffness * _longest_face()
        values['effort'] = *found.effort_map.slope, truth.most_force / (truth.most_effort - truth.idle_effort)
        alignment = found.alignment
        wanted = *truth.offset, truth.turn, *truth.tilt
        for name, each, true in zip(('x', 'y', 'turn', 'tilt x', 'tilt y'), alignment or (), wanted):
            values[name] = *each, true
            poses[name] = each.value - true
    if found.left_place and found.alignment:
        places = _places(truth, found.left_place, found.alignment)
        values |= places
        result['places'] = {name: value - true for name, (value, _, true) in places.items()}
    if found.held.is_known:
        true = truth.held_share + (1 - truth.held_share) * math.exp(-(60 * 7 / 8 - 3) / 8)
        values['held'] = *found.held, true
    shift = found.shift_per_load[0]
    if shift.is_known:
        values['shift per load'] = *shift, truth.shift_per_load
    proof = record['proof']
    return result | {'values': values, 'poses': poses, 'closes': [close[0] for close in proof.get('closes', [])],
                     'predicted': proof.get('predicted'), 'reason': proof.get('reason', '')}


def _places(truth: Truth, left: PadPlace, alignment: PadAlignment) -> dict[str, tuple[float, float, float]]:
    """Return each coordinate of both pads, and each angle of the left one, with its deviation and the truth."""
    offset = np.array((alignment.offset_x.value, alignment.offset_y.value))
    pose = left.pose((0.0,) * 6)
    places = zip(('left', 'right'), (pose.translation, pose.translation + pose.rotation[:, :2] @ offset),
                 (0.0, alignment.offset_x.deviation), (truth.place, truth.place + truth.axes[:, :2] @ truth.offset))
    found = {f'place {pad} {axis}': (float(value), math.hypot(left.x.deviation, error), float(true))
             for pad, values, error, trues in places for axis, value, true in zip('xyz', values, trues)}
    turn, tilt_x, tilt_y = Rotation.from_matrix(ALIGNED.T @ truth.axes).as_euler('ZYX')
    return found | {f'place {name}': (*each, float(true)) for name, each, true in (
        ('turn', left.turn, turn), ('tilt x', left.tilt_x, tilt_x), ('tilt y', left.tilt_y, -tilt_y))}


def print_bars(done: list[dict[str, Any]]) -> None:
    """Print each bar with its result."""
    print(f'{len(done)} grippers, {sum(not each["end"] for each in done)} finished')
    for each in done:
        if each['end'] or each['refused']:
            print(f'  seed {each["seed"]}: {each["end"] or "finished"}; {len(each["refused"])} repeats',
                  *sorted(set(each['refused'])), sep='\n      ')
    facts = [(each['seed'], name, *pair) for each in done for name, pair in each['facts'].items()]
    wrong = [each for each in facts if each[2] is not None and each[2] != each[3]]
    refused = [each[:2] for each in facts if each[2] is None]
    print(f'discrete facts: {len(facts)}, wrong {len(wrong)} (0), refused {len(refused)} (3)', *wrong, sep='\n  ')
    excess = [(each['seed'], name, found - true) for each in done for name, (found, true) in each['latencies'].items()
              if math.isfinite(found)]
    over = np.array([each[2] for each in excess])
    print(f'latency: at least the truth in {_percent(over >= 0)} (95 %), at most 20 ms above in '
          f'{_percent(over <= 0.02)} (100 %), largest {1e3 * over.max():.1f} ms')
    laws = np.array([each['law'] for each in done if 'law' in each])
    print(f'law: within 0.2 mm {_percent(laws[:, 0] <= 2e-4)}, scale within 1 % {_percent(laws[:, 1] <= 0.01)}; '
          f'largest {1e3 * laws[:, 0].max():.3f} mm, {100 * laws[:, 1].max():.2f} %')
    for name in ('x', 'y', 'turn', 'tilt x', 'tilt y'):
        errors = np.abs([each['poses'][name] for each in done if name in each['poses']])
        limit = 5e-4 if name in 'xy' else math.radians(1)
        print(f'pose {name}: within the limit {_percent(errors <= limit)} (95 %)')
    placed = [each['places'] for each in done if 'places' in each]
    lengths = np.abs([[error for name, error in each.items() if name[-1] in 'xyz' and 'tilt' not in name]
                      for each in placed])
    turns = np.abs([[error for name, error in each.items() if 'turn' in name or 'tilt' in name] for each in placed])
    print(f'places with a jig: {len(placed)} grippers, coordinates within 0.5 mm '
          f'{_percent(lengths <= 5e-4)} (95 %), largest error {1e3 * lengths.max():.2f} mm; angles within 1 degree '
          f'{_percent(turns <= math.radians(1))}, largest error {math.degrees(turns.max()):.2f} degrees')
    pooled: dict[str, list[bool]] = {}
    for each in done:
        for name, (value, deviation, true) in each['values'].items():
            if Estimate(value, deviation).is_known:
                pooled.setdefault(name.rstrip(' 01'), []).append(abs(value - true) <= 2 * deviation)
    print(f'within two deviations: {_percent(np.concatenate(list(pooled.values())))} (90-99 %)',
          ', '.join(f'{name} {_percent(inside)}' for name, inside in pooled.items()))
    closed = [each for each in done if each['closes']]
    below = np.concatenate([np.array(each['closes']) <= each['predicted'] for each in closed])
    overshoots = np.concatenate([each['closes'] for each in closed])
    predicted = float(np.median([each['predicted'] for each in closed]))
    print(f'closes: {len(overshoots)} with {len(closed)} grippers; overshoot below the prediction in '
          f'{_percent(below)} (95 %); median prediction {predicted:.2f} N, median overshoot '
          f'{np.median(overshoots):.2f} N (bar {2 * np.median(overshoots) + 0.3:.2f} N)')


def _percent(true: Any) -> str:
    return f'{100 * np.mean(true):.0f} %'


if __name__ == '__main__':
    sys.exit(main())
