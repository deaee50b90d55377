"""Pages with the results of recognition, which show the main columns of the recorded tables.

The script bench_recognition.py records its tables itself. The table of bench_real_arrays.py is copied from the output
of this script, and so were the tables of bench_hidden.py and bench_teach.py at commit ecd333e6.
"""

from bench.recognition.views import ResultPage, Row, View, across, columns, names, of

FOLDER = 'tables'  #: Folder of the recorded tables, next to the page.
READING = ('All rates are in per cent. `on/off` stands for frames of on/off taxels, `pressures` for all other frames. '
           '*Area* is the number of taxels of the contact. *Ours* is the learned method of this package. The *anchors* '
           'are the two [comparison methods](../recognition.md#comparison-methods), a CNN, and contours + trees. A '
           'rate in **bold** is lower than required. A rate with `*` is below the 95 % interval (Wilson) of the better '
           f'anchor. The CSV files in `{FOLDER}/` contain the intervals, the counts and further rows.')


def _recorded(row: Row) -> str:
    right = {'nus_ring_session': 'circle', 'nus_square_moving': 'square'}[row['recording']]
    return f'{row[right] if row["labelled"] == "object" else "-"} / {row["unknown"]} / {row["none"]}'


def _taught(row: Row) -> str:
    rates = of('fresh, same world, %', 'other world, %', 'after, %')(row)
    return rates + (', refused' if row['written'] == 'refused' else '')


THREE = of('ours, %', 'CNN, %', 'contours + trees, %')
KNOWN = (
    View('Real arrays', 'The recogniser as shipped answers each frame separately, without options, for the largest '
         'visible contact (`python bench/bench_real_arrays.py --tekscan TACTILE_OBJECT_RECOGNITION --weiss '
         'TACTILE_SENSORS --vitac VITAC --blocks TACTILE_SKIN`). *Sure* is the number of frames with a name at a '
         'confidence of 0.9 or more. For an object that is none of the five, every such name is wrong.',
         'Real arrays', ('array', 'visible'), names('frames', 'right, %', 'no name, %', 'sure', 'sure and wrong')),
    View('Real recordings', 'These are on/off recordings of a ring and of a square by the National University of '
         'Singapore (NUS). The frames were labelled by hand, and no training has used them. Each cell shows the '
         'answers right / unknown / none. In frames without the object, any shape is wrong.',
         'Real recordings', ('recording', 'labelled', 'frames'), across('contestant', _recorded),
         lambda row: row['labelled'] != 'unclear'),
    View('By size', 'The frames are clean. Each cell shows the share of {patterns} frames that is recognised by ours '
         '/ CNN / contours + trees.', 'Clean frames', ('area',), across('frames', THREE)),
    View('Expected calibration error', 'The same frames are used, with all sizes together and 15 bins.',
         'Expected calibration error', ('frames',), names('ours', 'CNN', 'contours + trees')),
    View('Contact mechanics', 'Computed indenters press an elastic half-space with a mean pressure of 5 to 80 % of '
         'full scale. The library evaluates the frames without options. There are {patterns} flat punches in each '
         'cell, and 200 of the other indenters. The columns are areas. Each cell shows the share that is recognised by '
         'ours / CNN / contours + trees.', 'Contact mechanics', ('condition',), across('area', THREE)),
    View('Several contacts on a pad', 'Two or three flat punches with the shapes of the five classes press the pad. '
         'All have the same area, and the weakest presses with 0.5 to 1 times the pressure of the strongest. There are '
         '200 or 300 punches in each cell. The columns are areas. Each cell shows the share of punches that are found '
         'as a separate contact / that are recognised / that are recognised when they are alone on the pad.',
         'Several contacts on a pad', ('punches', 'pitches between'),
         across('area', of('apart, %', 'recognised, %', 'alone, %'))))
FAULTS = (
    View('By noise and by faults of the skin', 'In each row, one condition differs from the nominal conditions. Each '
         'cell has {patterns} contacts. The columns are areas. Each cell shows two shares of contacts that our '
         'method recognises: first with on/off frames, then with pressures.',
         'Field conditions', ('condition',), across('area', of('ours, %'))),
    View('Skins with a halo', 'The cover of these computed skins carries load sideways, so that the taxels next to a '
         "contact also respond. The columns are these readings, in per cent of the contact's level. The gains of the "
         'taxels differ by 25 %, and the skins never read zero. Each cell has {contacts} contacts of 20 to 60 taxels, '
         'and shows the share recognised / with a name at a confidence of 0.9 or more. In the last row, the zero and '
         'the gain of each taxel are known, the gains with an error of 10 %.', 'Skins with a halo', ('frames read',),
         across('beside', of('recognised, %', 'sure, %'))),
    View('Hidden taxels', 'Contacts of 12-100 taxels lie in general position, 600 in each cell. Each TPDO carries 8 '
         'taxels of a row. Each cell shows the share of right answers / of answers with another shape at a confidence '
         'above 0.9, for the recogniser as shipped.',
         'Hidden taxels', ('hidden',),
         across('frames', of('right, with readings, %', 'wrong and sure, with readings, %'))),
    View('Missing TPDOs', 'Contacts of 40-100 taxels press a 16x16 pad with 32 TPDOs, 500 contacts in each cell. Ten '
         'frames with the same missing TPDOs are fused. Each cell shows three numbers: wrong / right / count. *Wrong* '
         'is the share of contacts that are reported as another shape at a confidence above 0.9. *Count* is the number '
         'of contacts of which less than 15 % is hidden, together with the taxels around them. *Right* is the share of '
         'these that are reported correctly at a confidence of 0.9 or more.', 'Missing TPDOs', ('missing TPDOs',),
         across('frames', of('wrong and sure, fused, %', 'right and sure, fused, %', 'of which little is hidden')),
         lambda row: bool(row['of which little is hidden'])))
OTHERS = (
    View('Nothing presses', 'The sequences have 50 frames at 50 Hz, on square pads with 8 to 64 taxels per side. Each '
         'row has {frames} frames. *Called a shape* is the share of single frames that are reported as one of the five '
         'shapes, with its 95 % interval. Left-over taxels are known only from earlier frames, so their frames are '
         'processed in sequence. *On the topic* is the longest time for which the nodes would report a shape in a '
         'stream of frames. At most 0.1 % and 0.1 s are required.', 'Nothing presses', ('kind',),
         names('called a shape, %', 'most often', 'on the topic, s')),
    View('Foreign shapes', 'The figures overlap with each of the five shapes by less than 0.85. Each cell has '
         '{patterns} figures. The columns are areas. Each cell shows the share that our method reports as unknown, '
         'on/off / pressures. From 40 taxels on, 98 % are required.',
         'Foreign shapes', ('shape',), across('area', of('ours, as shipped'))),
    View('Held contacts', 'Contacts with pressures are held in place. The frames at 50 Hz differ only in their noise, '
         'which is 3 % of the largest value. *Other shapes* are figures of all families of foreign shapes. Each cell '
         'shows the share that is sure / sure and wrong, with the frames fused until then. *Sure* is a name at a '
         'confidence of 0.9 or more. For other shapes, every such name is wrong. The columns are the times after the '
         'first frame.', 'Held contacts', ('contacts', 'area', 'number'),
         across('after, s', of('sure, %', 'sure and wrong, %'))),
    View('Foreign shapes taken for one of the five', 'The table combines all families of figures. Each row has '
         '{patterns} figures. *Sure* is the share that our method reports as one of the five at a confidence above '
         '0.9. The other columns show the share that is reported as unknown at a common loss: the limit for unknown is '
         'set so that 2 % of the known shapes of the same size and kind of frame are lost. The limits come from '
         'validation patterns. For the anchors, the limit applies to the highest probability.', 'Foreign shapes',
         ('frames', 'area'),
         columns(sure=of('called a shape, > 0.9 sure'), ours=lambda row: row['ours, 2 % loss'].split()[0],
                 CNN=of('CNN, 2 % loss'), trees=of('contours + trees, 2 % loss')), lambda row: row['shape'] == 'all'),
    View('Known shapes with a blemish', 'The contacts overlap with their shape by 0.92 to 0.98. Each cell has '
         '{patterns} contacts. The columns are areas. Each cell shows the share that our method recognises, on/off / '
         'pressures. From 100 taxels on, 90 % are required.', 'Known shapes with a blemish', ('blemish',),
         across('area', of('ours'))),
    View('Taught shapes', 'One shape at a time was taught from 30 touches of about 50 taxels on 16x16 taxels. '
         'Touches come from one of two worlds. The generator (*flat*) draws blurred coverage with a tilt and 1 % '
         'noise. Contact mechanics (*mechanics*) computes a punch in an elastic layer. Each column is the world in '
         'which the shape was taught. The test has 400 fresh touches of the generator or 120 of contact mechanics, '
         'one frame each. Each cell shows three rates. The first is the share of touches recognised in the same '
         'world, the second in the other world. The third is the share of 600 foreign figures that are reported as a '
         'shape; without a taught shape, this share is 8.9-10.0. The foreign figures do not include families of the '
         'taught shape. *Refused* means that `tactile teach` does not write the file.',
         'Taught shapes', ('shape',), across('taught in', _taught)))
PAGES = (
    ResultPage('bench/bench_recognition.py --page', 'recognition_results.md', FOLDER, 'The five shapes, as measured',
               READING, KNOWN, ('recognition_blind_spots.png', 'By orientation, place, size, aspect and pressure')),
    ResultPage('bench/bench_recognition.py --page', 'faults_results.md', FOLDER, 'Noise, faults and hidden taxels, as '
               'measured', READING, FAULTS),
    ResultPage('bench/bench_recognition.py --page', 'other_shapes_results.md', FOLDER, 'Nothing, other shapes and '
               'taught shapes, as measured', READING, OTHERS))
