"""The pages of results of recognition: what a reader decides by, of the tables that runs have recorded.

bench/bench_recognition.py records its own. Those of bench_hidden.py, bench_real_arrays.py and bench_teach.py are copied
from what these print.
"""

from bench.recognition.views import Page, Row, View, across, columns, names, of

FOLDER = 'tables'                      #: folder of the recorded tables, beside the page
READING = ('Rates are in per cent. `on/off`: taxels that are pressed or not; `pressures`: all others. *Area* is the '
           'size of the contact in taxels. **Bold**: less than required. `*`: ours is below the 95 % interval (Wilson) '
           f'of the better anchor. Intervals, counts and further rows are in the CSV files of `{FOLDER}/`. '
           '[How it works](../recognition.md) says what the anchors are, and where recognition fails.')


def _recorded(row: Row) -> str:
    right = {'nus_ring_session': 'circle', 'nus_square_moving': 'square'}[row['recording']]
    return f'{row[right] if row["labelled"] == "object" else "-"} / {row["unknown"]} / {row["none"]}'


def _taught(row: Row) -> str:
    rates = of('fresh, same world, %', 'other world, %', 'after, %')(row)
    return rates + (', refused' if row['written'] == 'refused' else '')


THREE = of('ours, %', 'CNN, %', 'contours + trees, %')
KNOWN = (
    View('Real arrays', 'Largest visible contact, frame by frame, as shipped and without options '
         '(`python bench/bench_real_arrays.py --tekscan TACTILE_OBJECT_RECOGNITION --weiss TACTILE_SENSORS --vitac '
         'VITAC`). *Sure*: frames with a name of confidence 0.9 or more, which for none of the five is wrong.',
         'Real arrays', ('array', 'visible'), names('frames', 'right, %', 'no name, %', 'sure', 'sure and wrong')),
    View('Real recordings', 'NUS ring and square, on/off, by labels given by hand; no training has seen them. Frames '
         'with the object, and frames without it, where any shape is wrong: right / unknown / none.',
         'Real recordings', ('recording', 'labelled', 'frames'), across('contestant', _recorded),
         lambda row: row['labelled'] != 'unclear'),
    View('By size', 'Clean frames, {patterns} a cell: recognised by ours / CNN / contours + trees.', 'Clean frames',
         ('area',), across('frames', THREE)),
    View('Expected calibration error', 'Of the same frames, all sizes, 15 bins.', 'Expected calibration error',
         ('frames',), names('ours', 'CNN', 'contours + trees')),
    View('Contact mechanics', 'Indenters on an elastic half-space, mean pressure 5 to 80 % of full scale, as the '
         'library sees them without options, by area: recognised by ours / CNN / contours + trees. Flat punches '
         '{patterns} a cell, others 200.', 'Contact mechanics', ('condition',), across('area', THREE)),
    View('Several contacts on a pad', 'Flat punches of the five shapes, all of one area, the weakest pressed with 0.5 '
         'to 1 of the strongest; 200 or 300 punches a cell. By area: punches with a contact of their own / recognised '
         '/ recognised when alone on the pad.', 'Several contacts on a pad', ('punches', 'pitches between'),
         across('area', of('apart, %', 'recognised, %', 'alone, %'))),
    View('Time of a single frame', 'Median, one core, each alone [us]: ours from the contact pattern on / CNN / '
         'contours + trees from a prepared patch on, whose making is not counted.', 'Time of a single frame',
         ('area',), across('frames', of('ours', 'CNN', 'contours + trees'))))
FAULTS = (
    View('By noise and by faults of the skin', 'One condition changed, the rest nominal, {patterns} a cell: recognised '
         'by ours, on/off / pressures, by area.', 'Field conditions', ('condition',), across('area', of('ours, %'))),
    View('Hidden taxels', 'Contacts of 12-100 taxels in general position; TPDOs of 8 taxels in a row '
         '(`python bench/bench_hidden.py`, 600 a cell), as shipped: right / another shape with more than 0.9 '
         'confidence.',
         'Hidden taxels', ('hidden',),
         across('frames', of('right, with readings, %', 'wrong and sure, with readings, %'))),
    View('Missing TPDOs', 'Contacts of 40-100 taxels on a 16x16 pad of 32 TPDOs, 500 a cell. *Wrong*: another shape '
         'with more than 0.9 confidence. *Right*: with 0.9 or more, of those contacts of which less than 15 % is '
         'hidden, with the taxels around them. Ten frames fused, with the same TPDOs missing: wrong / right / contacts '
         'of which so little is hidden.', 'Missing TPDOs', ('missing TPDOs',),
         across('frames', of('wrong and sure, fused, %', 'right and sure, fused, %', 'of which little is hidden')),
         lambda row: bool(row['of which little is hidden'])))
OTHERS = (
    View('Nothing presses', 'Sequences of 50 frames at 50 Hz, pads of 8 to 64 taxels square, {frames} frames a row: '
         'single frames called one of the five shapes (of what is left over: frames that follow each other), with '
         'their 95 % interval, and the longest time that a stream, as the nodes, has a shape on the topic. Required: '
         'at most 0.1 % and 0.1 s.', 'Nothing presses', ('kind',),
         names('called a shape, %', 'most often', 'on the topic, s')),
    View('Foreign shapes', 'Figures whose best overlap with any of the five is below 0.85, {patterns} a cell, by '
         'area: called unknown by ours, on/off / pressures. Required: 98 % from 40 taxels up.',
         'Foreign shapes', ('shape',), across('area', of('ours, as shipped'))),
    View('Foreign shapes taken for one of the five', 'All families together, {patterns} a row. *Sure*: called one of '
         'the five with more than 0.9 confidence. Then: called unknown, each at a limit that loses 2 % of known shapes '
         'of that size and kind of frame (of validation patterns); anchors by their highest probability.',
         'Foreign shapes', ('frames', 'area'),
         columns(sure=of('called a shape, > 0.9 sure'), ours=lambda row: row['ours, 2 % loss'].split()[0],
                 CNN=of('CNN, 2 % loss'), trees=of('contours + trees, 2 % loss')), lambda row: row['shape'] == 'all'),
    View('Known shapes with a blemish', 'Overlap with the shape 0.92 to 0.98, {patterns} a cell: recognised by ours, '
         'on/off / pressures. Required: 90 % from 100 taxels up.', 'Known shapes with a blemish', ('blemish',),
         across('area', of('ours'))),
    View('Taught shapes', '`python bench/bench_teach.py`: 30 touches of about 50 taxels on 16x16, one shape at a time; '
         'then 400 fresh touches of the generator (*flat*: blurred coverage, tilt, 1 % noise) or 120 of contact '
         'mechanics (*mechanics*: a punch in an elastic layer), one frame each: recognised in the world taught in / '
         'recognised in the other / foreign figures called a shape, of 600, families of the taught shape left out '
         '(without it 8.9-10.0). `tactile teach` writes no file of a refused one.', 'Taught shapes', ('shape',),
         across('taught in', _taught)))
PAGES = (
    Page('bench/bench_recognition.py --page', 'recognition_results.md', FOLDER, 'The five shapes, as measured', READING,
         KNOWN, ('recognition_blind_spots.png', 'By orientation, place, size, aspect and pressure')),
    Page('bench/bench_recognition.py --page', 'faults_results.md', FOLDER, 'Noise, faults and hidden taxels, as '
         'measured', READING, FAULTS),
    Page('bench/bench_recognition.py --page', 'other_shapes_results.md', FOLDER, 'Nothing, other shapes and taught '
         'shapes, as measured', READING, OTHERS))
