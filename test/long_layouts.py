"""The shipped layouts with every TPDO written out, as they are without ``repeat``."""


def entry(number, cob_id, mapped, first, taxels, more=''):
    return (f'- {{{more}number: {number}, cob_id: $NODEID+0x{cob_id:03X}, {mapped},\n'
            f'   taxels: {{first: {list(first)}, step: [0, 1], {taxels}}}}}')


def in_ranges(number, each):
    """COB-ID of TPDO ``number``: ``each`` of them in each of the ranges 0x180, 0x280, 0x380, 0x480."""
    return 0x180 + 0x100 * ((number - 1) // each) + (number - 1) % each


def across_ranges(number):
    """COB-ID of TPDO ``number``: 0x180, 0x280, 0x380, 0x480, 0x181, 0x281..."""
    return 0x180 + 0x100 * ((number - 1) % 4) + (number - 1) // 4


SIM16X16 = [entry(number, in_ranges(number, 8),
                  f'map: {{object: 0x{0x2100 + (number - 1) // 2:04X}, sub: {1 if number % 2 else 9}, '
                  'bits: 8, count: 8}',
                  ((number - 1) // 2, 0 if number % 2 else 8), 'count: 8, bit_step: 8') for number in range(1, 33)]
SIM8X8 = [entry(number, in_ranges(number, 4), f'map: {{object: 0x7130, sub: {4 * number - 3}, bits: 16, count: 4}}',
                ((number - 1) // 2, 0 if number % 2 else 4), 'count: 4, bit_step: 16') for number in range(1, 17)]
NUS = [entry(number, in_ranges(number, 16), f'map: {{object: 0x2200, sub: {number}, bits: 64}}', (number - 1, 0),
             'count: 64, bit_step: 1') for number in range(1, 65)]
NODES2 = [entry(number, across_ranges(number),
                f'map: {{object: 0x{0x2300 + (number - 1) // 2:04X}, sub: {1 if number % 2 else 7}, '
                'bits: 8, count: 6}',
                (6 * node + (number - 1) // 2, 0 if number % 2 else 4), 'count: 4, bit_step: 12', f'node: {node}, ')
          for node in (0, 1) for number in range(1, 13)]
MPDO = [entry(1, 0x180, f'mpdo: {{object: 0x{0x2100 + row:04X}, sub: 1, count: 4, step: [0, 2]}}', (row, 0),
              'count: 2, start_bit: 32, bit_step: 16') for row in range(8)]
LONG = {'sim16x16': SIM16X16, 'sim8x8_16bit': SIM8X8, 'nus_sinapse_64x64': NUS, 'nodes2_12x8_12bit': NODES2,
        'mpdo8x8_16bit': MPDO}


def written_out(text, name):
    """The text of the layout ``name`` with its TPDOs one by one."""
    return text[:text.index('tpdos:\n')] + 'tpdos:\n' + '\n'.join(LONG[name]) + '\n'
