"""The page of results of pose, size and fusion: what a reader decides by, of the tables that runs have recorded.

bench_pose.py records its own. Those of bench_box.py and bench_calibration.py are copied from what these print.
"""

from bench.recognition.views import Page, Row, View, across, columns, names, of

FOLDER = 'pose_tables'  #: folder of the recorded tables, beside the page
READING = ('Errors are medians: of the centre in pitches, of the angle in degrees (by the symmetry that the fit '
           'declares), of the worst length in per cent. *N*: taxels of the contact. *Region*: share whose '
           'true parameters are all in the 95 % region, in per cent. Intervals and '
           f'95th percentiles: CSV files of `{FOLDER}/`. Where it fails: [pose.md](pose.md).')
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
    View('Errors at N = 50', 'Centre / angle / length.', 'Errors', ('frames',), across('shape', ERRORS), _is_main),
    View('By size', 'The five shapes together: centre / angle / length; region.', 'Against the area', ('N',),
         across('frames', lambda row: f'{row["centre / angle / length"]}; '
                                      f'{row["95 % region holds the truth"].split("%")[0]}')),
    View('Beside simple alternatives', 'The five shapes together, N = 50: centre / angle / length. Moments: closed '
         'forms up to the fourth moment, which assume the shape too. Rectangle: the least one about the taxels.',
         'Beside simple alternatives', ('frames',), names('ours', 'moments', 'least rectangle'),
         lambda row: row['frames'] in ('clean', 'on/off')),
    View('95 % regions at N = 50', 'Wanted: 93-97 %.', 'Regions', ('frames',),
         columns(all=of('all'), least_of_the_five=_least)),
    View('Which corner is the apex', 'A nearly equilateral triangle may show three apexes: the fit '
         'says symmetry 3, and the errors above count by that. Wrong, unsaid: the apex is another corner and the fit '
         'says symmetry 1.', 'Corners', ('frames',),
         columns(symmetry_3=of('symmetry 3'), wrong_apex=of('wrong apex'), wrong_unsaid=of('wrong, unsaid')),
         _is_main),
    View('On contact mechanics', 'Rigid objects on an elastic half-space, taxels under a layer of unknown depth, '
         'pressure 5-80 % of full scale, noise 1 %, 3 % dead; {fits} contacts a cell. The truth is the outline of the '
         'contact set. By N: bias / spread (half of the 16-84 % range) of the mean length / centre / angle / region. '
         'Wanted of flat punches: at most 3, 3, 0.03, 0.5; of all regions: 92-98 %.', 'Contact mechanics', ('object',),
         across('N', of('bias', 'spread', 'centre', 'angle', 'in the 95 % region'))),
    View('A calibrated skin', '`python bench/bench_calibration.py`: punches of the five shapes, 60 frames a cell, '
         'reporting seeds, on skins whose response is not given to the fit: readings grow as the pressure, as its '
         'power 0.6 or 1.3, or saturate; depth in pitches. Without -> with `tactile calibrate`, by N: bias of the '
         'length; region.', 'Calibrated skin', ('depth', 'readings'),
         across('N', lambda row: f'{row["bias before"]} -> {row["bias after"]}; '
                                 f'{row["inside before"]} -> {row["inside after"]}'), lambda row: row['N'] != '50'),
    View('The least rectangle', '`python bench/bench_box.py --contacts 40`, evaluation seeds. Punches, balls, '
         'cylinders and cones are those of the contact mechanics below 1.2 pitches of skin, noise 1 %, 3 % dead; '
         'others have an even pressure, blur 0.5, noise 1 %, 2 % dead. By N: bias of the long side / of the short one '
         '/ error of the angle / share in the 95 % interval, the least of long, short, centre, angle.',
         'Least rectangle', ('object',), across('N', _box), lambda row: row['N'] in ('12', '100')),
    View('Time of one fit', 'Processor time, one core [ms].', 'Time of one fit', ('frames',),
         lambda rows: {shape: _median(rows[0], shape) for shape in rows[0] if shape != 'frames'},
         lambda row: row['frames'] in ('clean', 'on/off')),
    View('Fusion of successive frames', '40 sequences at 100 Hz: 60 frames of one shape, then at once 60 of another '
         '(no frame between them empty), creeping 0.01 pitch a frame, blur 0.5, noise 2 %. *Settled*: from 100 ms '
         '(200 ms after a change) on. *Flicker*: changes of the shape reported, beside the true one, per 100 frames.',
         'Fusion of successive frames', ('recogniser', 'N'),
         columns(right_single=of('right, single frames'),
                 settled=of('right, fused, from 100 ms (200 ms after a change) on'),
                 flicker_single=of('flicker single'), flicker_fused=of('flicker fused'),
                 frames_to_follow=lambda row: row['frames to follow a change, median; 95 %; most'])))
PAGE = Page('bench/bench_pose.py --page', 'pose_results.md', FOLDER, 'Pose, size and fusion, as measured', READING,
            VIEWS)
