"""Record touches of a pad during a commissioning, and save the results of `tactile calibrate` and `tactile assess`.

Both commands can read the same recording, so the person may use an existing recording again.
"""

import argparse
import io
from collections.abc import Sequence
from contextlib import redirect_stdout
from pathlib import Path
from types import ModuleType

from tactile_node.cli import assess, calibrate
from tactile_node.cli.frame_file import TaxelFrames, write_archive
from tactile_node.commissioning.commissioned_gripper import Act, Person, Question
from tactile_node.commissioning.commissioning_record import CommissioningRecord
from tactile_node.errors import ConfigurationError
from tactile_node.gripper.ros_gripper import RosGripper
from tactile_node.output_file import output_file
from tactile_node.shape.recognition import Shape
from tactile_node.taxel_frame import TaxelFrame

DISC = 'circle'  #: name under which `tactile assess` knows the disc of `tactile calibrate`
HOW = {DISC: 'Press the flat disc onto the pad {pad!r} at six or more places, lightly and firmly.',
       'unknown': 'Touch the pad {pad!r} 8 times or more, each time with a different object of an unknown shape.'}
OTHERS = 'Touch the pad {pad!r} 8 times or more with the object {name!r}. Rotate the object between the touches.'
ENDING = ' Keep away from the edges, and lift the object between the touches.'


def measure_skin(gripper: RosGripper, person: Person, pad: str, record: CommissioningRecord, folder: Path,
                 radius: float | None, names: Sequence[str]) -> bool:
    """Carry out the steps `response` (if ``radius`` is given) and `assessment` (if ``names`` are given).

    Parameters
    ----------
    pad : str
        Name of the first pad.
    radius : float or None
        Radius of the flat disc [m].
    names : sequence of str
        Names of the objects, as for `tactile assess`.

    Returns
    -------
    bool
        True if the driver does not use the measured response yet, so that its forces do not match the parameters.

    Raises
    ------
    TactileError
        Raised if a recording cannot be used. The finished steps are kept.
    """
    if radius and 'response' not in record:
        if gripper.first_frame.layer_depth:
            raise ConfigurationError('--disc', expected='a driver without response_files', got='one that uses them',
                                     remedy='Start the driver without response_files, or leave --disc out.')
        response = folder / f'skin{calibrate.RESPONSE_SUFFIX}'
        recording = _recording(gripper, person, pad, folder, DISC, f'the disc with a radius of {1e3 * radius:g} mm')
        text = _printed(calibrate, [recording, '--radius', f'{radius:.6g}', '--output', str(response), '--force'])
        record.save('response', {'file': str(response.resolve()), 'text': text})
    if names and 'assessment' not in record:
        model = folder / 'skin_model.npz'
        model.unlink(missing_ok=True)
        words = [word for name in names
                 for word in ('--name', name, '--from', _recording(gripper, person, pad, folder, name, name))]
        text = _printed(assess, [*words, '--output', str(model)])
        # without unknown objects, it is not known how the adapted model answers other objects
        is_used = model.exists() and Shape.UNKNOWN.value in names
        record.save('assessment', {'file': str(model.resolve()) if is_used else '', 'text': text})
    return 'response' in record and not gripper.first_frame.layer_depth


def _printed(command: ModuleType, words: Sequence[str]) -> str:
    """Run a sub-command, and return what it prints."""
    parser = argparse.ArgumentParser()
    command.add_options(parser)
    with redirect_stdout(io.StringIO()) as text:
        command.run(parser.parse_args(words))
    print(text.getvalue())
    return text.getvalue()


def _recording(gripper: RosGripper, person: Person, pad: str, folder: Path, name: str, toucher: str) -> str:
    """Return the file with touches of an object, recorded now or earlier. ``toucher`` describes the object."""
    path = folder / f'touches_{name}.npz'
    question = f'Are all touches in {path} touches of {toucher}, and shall they be used?'
    if path.exists() and person.ask(Question(Act.REUSE, question, ('yes', 'no'))) == 'yes':
        return str(path)
    person.ask(Question(Act.STROKE, HOW.get(name, OTHERS).format(pad=pad, name=name) + ENDING))
    frames: list[TaxelFrame] = []
    gripper.tap = frames
    person.ask(Question(Act.CLEAR, 'Take the object away.'))
    gripper.tap = None
    first = gripper.first_frame
    with output_file(path) as stream:
        write_archive(stream, TaxelFrames.of(frames, (first.rows, first.cols), pad, first.pitch, first.unit))
    return str(path)
