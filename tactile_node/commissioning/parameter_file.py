"""Write the parameters that a commissioning has measured, as a file that the launch file reads (params_file:=...).

A parameter that was not measured is absent, so that its absence is visible in the report.
"""

import math
from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
import yaml
from scipy.spatial.transform import Rotation

from tactile_node.commissioning.evaluation import Evaluation
from tactile_node.commissioning.pad_alignment import PadAlignment
from tactile_node.commissioning.pad_mounting import PadMounting, taxel_places
from tactile_node.commissioning.plan import CommissioningPlan
from tactile_node.commissioning.recording import PadGrid
from tactile_node.grasp.frame_tree import IDENTITY_TRANSFORM, Transform
from tactile_node.output_file import output_file

#: Frame of the poses of the pads without a jig. A transform from the palm to this frame has to come from the robot.
FRAME = 'left_pad_centre'
#: Share of the allowed speed that is written, so that rounding does not exceed the allowed overshoot.
SPEED_SHARE = 0.99
HEAD = '''# Parameters that `tactile commission` has measured. Pass this file with params_file:=.
# A parameter that is missing here was not measured; the report gives the reason.
# touch_force is the overshoot for which slow_speed and fast_speed are chosen. With gripper_effort, the gripper presses
# with the force limit.
# With a jig, the poses of the pads are in the frame of the gripper to which --jig refers; set frame_id to its name.
# Without a jig, they are relative only: {frame} lies in the middle of the left skin, with z towards the right pad.
'''


class MeasuredParameters(NamedTuple):
    """Parameters of each node, the reason for each parameter that is missing, and notes about their use."""

    nodes: dict[str, dict[str, Any]]
    absent: dict[str, str]
    notes: list[str]


def measured_parameters(found: Evaluation, plan: CommissioningPlan) -> MeasuredParameters:
    """Return the parameters that were measured."""
    nodes: dict[str, dict[str, Any]] = {'skin_driver': {}, 'grasp': {}, 'touch_gripper': {}, 'classifier': {}}
    absent: dict[str, str] = {}
    for step, node, name in (('response', 'skin_driver', 'response_files'), ('assessment', 'classifier', 'model')):
        if file := found.record[step].get('file'):
            nodes[node][name] = [file] if node == 'skin_driver' else file
        else:
            absent[name] = ('the model was not improved, or no unknown objects were touched' if found.record[step]
                            else 'the skin was not measured')
    _add_opening(nodes, absent, found, plan)
    _add_pads(nodes, absent, found, plan)
    _add_closing(nodes, absent, found, plan)
    shift, reason = found.shift_per_load
    if shift.is_known:
        nodes['classifier']['shift_per_load'] = _rounded(abs(shift.value) + 2 * shift.deviation)
    else:
        absent['shift_per_load'] = reason
    return MeasuredParameters({node: values for node, values in nodes.items() if values}, absent,
                              _notes(nodes['touch_gripper'], found, plan))


def write_parameters(path: str, parameters: MeasuredParameters) -> None:
    """Write the parameters as YAML."""
    content = {f'/**/{node}': {'ros__parameters': values} for node, values in parameters.nodes.items()}
    with output_file(path) as stream:
        stream.write((HEAD.format(frame=FRAME) + yaml.safe_dump(content, sort_keys=False,
                                                                default_flow_style=None)).encode())


def _add_opening(nodes: dict[str, dict[str, Any]], absent: dict[str, str], found: Evaluation,
                 plan: CommissioningPlan) -> None:
    offset, scale, reason = found.launched_law
    if reason:
        absent['gap_offset, gap_scale'] = reason
        return
    law = {'gap_scale': _rounded(scale), 'gap_offset': _rounded(offset)}
    nodes['grasp'] |= {'gap_source': 'joint_states', 'gap_joints': [plan.joint], **law}
    nodes['touch_gripper'] |= {'joint': plan.joint, **law}


def _add_pads(nodes: dict[str, dict[str, Any]], absent: dict[str, str], found: Evaluation,
              plan: CommissioningPlan) -> None:
    if found.is_swapped is None:
        absent['left_pad, right_pad'] = 'the step `pads` was not finished'
    elif found.is_swapped:
        absent['left_pad, right_pad'] = 'the pads are swapped: exchange their names in `pads` of the launch file'
    if mirrored := [name for name, mounting in zip(found.names, found.mountings) if mounting.is_mirrored]:
        nodes['skin_driver']['mirrored_pads'] = mirrored
    if found.alignment is None or not found.mountings or not all(each.is_known for each in found.alignment):
        absent['left_xyz, left_rpy, right_xyz, right_rpy'] = 'the pads were not compared with a free block'
    else:
        place = found.left_place
        nodes['grasp'] |= {'frame_id': FRAME} if place is None else {}
        nodes['grasp'] |= pad_poses(plan.grid, found.mountings, found.alignment,
                                    IDENTITY_TRANSFORM if place is None else place.pose(plan.jig))


def _add_closing(nodes: dict[str, dict[str, Any]], absent: dict[str, str], found: Evaluation,
                 plan: CommissioningPlan) -> None:
    closing = nodes['touch_gripper']
    if found.stop_by is None:
        absent['stop_by'] = 'no way to stop is reliable and keeps the force, or the stops were not tried'
    else:
        closing['stop_by'] = found.stop_by.value
    speed = SPEED_SHARE * found.allowed_speed(plan.overshoot)
    for name, value in (('latency', found.latency), ('stiffness', found.stiffness.upper),
                        ('gripper_step', found.step.value), ('slow_speed', speed), ('fast_speed', speed)):
        if math.isfinite(value) and value > 0:
            closing[name] = _rounded(value)
        else:
            absent[name] = 'not measured' if name not in ('slow_speed', 'fast_speed') else \
                'no speed keeps the predicted overshoot, or it is not known'
    if 'fast_speed' in closing:
        closing['touch_force'] = plan.overshoot
    if found.effort_map.is_known:
        effort = min(found.effort_map.effort(plan.force_limit), plan.most_effort)
        closing |= {'gripper_effort': _rounded(effort), 'highest_force': plan.force_limit}
    else:
        absent['gripper_effort'] = 'the map from effort to force is not known'


def _notes(closing: Mapping[str, Any], found: Evaluation, plan: CommissioningPlan) -> list[str]:
    """Return what a person has to know about the parameters of touch_gripper before using them."""
    notes = []
    if 'gripper_effort' in closing:
        notes.append(f'If touch_gripper is killed, gripper_effort {closing["gripper_effort"]:.3g} is the only '
                     'remaining limit of the force.')
    if 'fast_speed' in closing and found.law:
        speed, start = closing['fast_speed'], found.widest_opening
        end = sorted(block.width for block in plan.blocks)[len(plan.blocks) // 2]
        notes.append(f'fast_speed equals slow_speed ({1e3 * speed:.3g} mm/s). Closing from {1e3 * start:.3g} mm to '
                     f'{1e3 * end:.3g} mm takes {(start - end) / speed:.0f} s, because the latency is '
                     f'{1e3 * found.latency:.0f} ms. If this is too long, reduce the latency. Give the goal enough '
                     'time.')
    return notes


def pad_poses(grid: PadGrid, mountings: list[PadMounting], alignment: PadAlignment,
              left: Transform = IDENTITY_TRANSFORM) -> dict[str, list[float]]:
    """Return xyz and rpy of taxel (0, 0) of both pads, after the driver has mirrored the mirrored pads.

    ``left`` is the pose of FRAME in the frame of the result.
    """
    x, y, turn, tilt_x, tilt_y = (each.value for each in alignment)
    facing = Rotation.from_euler('YXZ', (-tilt_x, tilt_y, turn)).as_matrix() @ np.diag((-1.0, 1.0, -1.0))
    poses: dict[str, list[float]] = {}
    for name, mounting, frame, centre in (('left', mountings[0], np.eye(3), np.zeros(3)),
                                          ('right', mountings[1], facing, np.array((x, y, 0.0)))):
        corner = taxel_places(grid, mounting._replace(is_mirrored=False))[0, 0]
        turned = Rotation.from_euler('z', 90 * mounting.quarter_turns, degrees=True).as_matrix()
        pose = left @ Transform(frame @ turned, centre + frame[:, :2] @ corner)
        poses[f'{name}_xyz'] = [_rounded(each) for each in pose.translation]
        poses[f'{name}_rpy'] = [_rounded(each) for each in Rotation.from_matrix(pose.rotation).as_euler('xyz')]
    return poses


def _rounded(value: float) -> float:
    """Return a value with seven significant digits, which is far below every spread."""
    return float(f'{value:.7g}')
