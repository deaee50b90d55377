"""The page with the results of pose and size, which shows the main columns of the recorded tables.

The script bench_pose.py records its tables itself. The tables of the calibrated skin and of the least rectangle were
copied from the output of bench_calibration.py and bench_box.py at commit ecd333e6.
"""

from bench.recognition.views import ResultPage, Row, View, across, columns, of

FOLDER = 'pose_tables'  #: Folder of the recorded tables, next to the page.
READING = ('All errors are medians. The error of the centre is in pitches. The error of the angle is in degrees and '
           'allows for the symmetry that the fit declares. The error of the length is that of the worst length, in per '
           'cent. *N* is the number of taxels of the contact. *Region* is the share of fits whose true parameters are '
           f'all within the 95 % region, in per cent. The CSV files in `{FOLDER}/` contain the intervals and the 95th '
           'percentiles. [pose.md](pose.md) describes where the fit fails.')
ERRORS = of('centre', 'angle', 'length %')


def _median(row: Row, shape: str) -> str:
    return row[shape].split('; ')[1]


def _box(row: Row) -> str:
    inside = min(int(row[f'{name} inside']) for name in ('long', 'short', 'centre', 'angle'))
    return f'{row["long, bias %"]} / {row["short, bias %"]} / {row["angle, error"]} / {inside}'


def _least(row: Row) -> str:
    shapes = [name for name in row if name not in ('frames', 'all')]
    least = min(shapes, key=lambda shape: float(row[shape].rstrip('%')))
    return f'{row[least]}, {least}'


def _is_main(row: Row) -> bool:
    return row['frames'] in ('clean', 'tilt 4 %', 'all four', 'on/off')


VIEWS = (
    View('Errors at N = 50', 'Each cell shows the errors of centre / angle / length.', 'Errors', ('frames',),
         across('shape', ERRORS), _is_main),
    View('By size', 'The table combines all five shapes. Each cell shows the errors of centre / angle / length, then '
         'the region.',
         'Against the area', ('N',),
         across('frames', lambda row: f'{row["centre / angle / length"]}; '
                                      f'{row["95 % region holds the truth"].split("%")[0]}')),
    View('95 % regions at N = 50', 'The required share is 93-97 %.', 'Regions', ('frames',),
         columns(all=of('all'), least_of_the_five=_least)),
    View('Which corner is the apex', 'In a nearly equilateral triangle, any corner may look like the apex. The fit '
         'then declares symmetry 3, and the errors above allow for this. *wrong unsaid* is the share of fits that '
         'mistake another corner for the apex but declare symmetry 1.', 'Corners', ('frames',),
         columns(symmetry_3=of('symmetry 3'), wrong_apex=of('wrong apex'), wrong_unsaid=of('wrong, unsaid')),
         _is_main),
    View('On contact mechanics', 'Rigid objects press an elastic half-space. The taxels lie under a layer of unknown '
         'depth. The pressure is 5-80 % of full scale, with 1 % noise and 3 % dead taxels; {fits} contacts in each '
         'cell. The true outline is that of the computed contact. The columns are N. Each cell shows the bias / spread '
         '(half of the 16-84 % range) of the mean length / error of the centre / error of the angle / region. For flat '
         'punches, at most 3, 3, 0.03 and 0.5 are required. For all objects, regions of 92-98 % are required.',
         'Contact mechanics', ('object',), across('N', of('bias', 'spread', 'centre', 'angle', 'in the 95 % region'))),
    View('A calibrated skin', 'We measured this table once, with `bench/bench_calibration.py` at commit ecd333e6. '
         'Punches of the five shapes press skins whose response the fit does not know; 60 frames in each cell, '
         'evaluation seeds. The readings are proportional to the pressure or to its power 0.6 or 1.3, or they '
         'saturate. The depth is in pitches. The columns are N. Each cell shows the bias of the length, then the '
         'region, each without -> with `tactile calibrate`.',
         'Calibrated skin', ('depth', 'readings'),
         across('N', lambda row: f'{row["bias before"]} -> {row["bias after"]}; '
                                 f'{row["inside before"]} -> {row["inside after"]}'), lambda row: row['N'] != '50'),
    View('The least rectangle', 'We measured this table once, with `bench/bench_box.py --contacts 40` at commit '
         'ecd333e6, with evaluation seeds. Punches, balls, cylinders and cones are computed by contact mechanics under '
         '1.2 pitches of skin, with 1 % noise and 3 % dead taxels. The other objects press evenly, with a blur of 0.5 '
         'pitches, 1 % noise and 2 % dead taxels. The columns are N. Each cell shows the bias of the long side / bias '
         'of the short side / error of the angle / share of true values in the 95 % interval. The last number is the '
         'smallest of the shares for long side, short side, centre and angle.',
         'Least rectangle', ('object',), across('N', _box), lambda row: row['N'] in ('12', '100')),
    View('Time of one fit', 'The table shows the processor time on one core [ms].', 'Time of one fit', ('frames',),
         lambda rows: {shape: _median(rows[0], shape) for shape in rows[0] if shape != 'frames'},
         lambda row: row['frames'] in ('clean', 'on/off')))
PAGE = ResultPage('bench/bench_pose.py --page', 'pose_results.md', FOLDER, 'Pose and size, as measured',
                  READING, VIEWS)
