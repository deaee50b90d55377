"""A report page is self-contained and runs no script.

The page names the facts that the recording does not contain. Pages made from bags are tested, too.
"""

import re
import sys
from dataclasses import replace
from html.parser import HTMLParser
from threading import Event

import numpy as np
import pytest
from test_report import BEGIN, NAME_UPLOAD, SESSION, logged, report_of, session, status
from test_topic_bag import TAXELS, bag, store, taxel_array

from tactile_node.cli.main import main
from tactile_node.logs.topic_bag import DIAGNOSTICS
from tactile_node.shape.recognition import Recognition, Shape, TaughtShape
from tactile_node.taxel_frame import TaxelStatus
from tactile_node.viewing.findings import Remark, findings
from tactile_node.viewing.recordings import BagRecording
from tactile_node.viewing.report_page import TAUGHT_COLOUR, page_of
from tactile_node.viewing.reported_file import Kind
from tactile_node.viewing.reporter import BagReporter
from tactile_node.viewing.status_record import StatusRecord
from tactile_node.viewing.templates import ABSENT_TEXT

pytest.importorskip('jinja2')
#: The page permits its own styles and pictures, and nothing else.
POLICY = "default-src 'none'; img-src data:; style-src 'unsafe-inline'"
VOID = {'meta', 'br', 'path', 'rect', 'polygon', 'polyline'}
NAN = float('nan')


class Page(HTMLParser):
    """Tags, attributes and text of a page, where ``open`` lists the tags that were not closed."""

    def __init__(self, text):
        super().__init__()
        self.tags, self.attributes, self.texts, self.open = [], [], [], []
        self.feed(text)
        self.close()

    def handle_starttag(self, tag, attrs):
        self.tags.append(tag)
        self.attributes += attrs
        if tag not in VOID:
            self.open.append(tag)

    def handle_startendtag(self, tag, attrs):
        self.tags.append(tag)
        self.attributes += attrs

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        self.texts.append(data)


def check_alone(text):
    """Check that a page loads no file and runs no script, and return the parsed page."""
    page = Page(text)
    assert not page.open
    assert not {'script', 'link', 'iframe', 'object', 'embed', 'base', 'form', 'img'} & set(page.tags)
    names = {name for name, _ in page.attributes}
    assert not names & {'src', 'xlink:href', 'srcset', 'action', 'data'} and not any(
        name.startswith('on') for name in names)
    pictures = [value for name, value in page.attributes if name == 'href']
    assert all(re.fullmatch('data:image/png;base64,[A-Za-z0-9+/]+=*', value) for value in pictures)
    others = {value or '' for name, value in page.attributes if name != 'href'} - {POLICY}
    assert not any('//' in value or 'data:' in value for value in others)
    assert '@import' not in text and 'url(' not in text
    return page


def frames(count=30):
    """Yield frames, with a square from the tenth frame on.

    Taxel (0, 0) is dead. Taxel (0, 1) is missing in half of the frames.
    """
    for k in range(count):
        values, status = np.zeros((16, 16), np.float32), np.ones((16, 16), np.uint8)
        if k >= 10:
            values[5:10, 5:10] = 60e3
        values[0, 0], status[0, 0] = NAN, TaxelStatus.DEAD
        if k % 2:
            values[0, 1], status[0, 1] = NAN, TaxelStatus.STALE
        stamp = store().types['builtin_interfaces/msg/Time'](*divmod(BEGIN * 10**9 + k * 20_000_000, 10**9))
        header = store().types['std_msgs/msg/Header'](stamp, '<b>pad</b>')
        yield taxel_array(store(), k + (k >= 20), header=header, rows=16, cols=16, values=values.reshape(-1),
                          status=status.reshape(-1), missing_can_frames=k % 2)


def reported(path):
    return BagReporter(BagRecording(str(path))).report(Event())


@pytest.mark.slow
def test_the_page_of_a_log_is_alone_and_escapes_what_devices_send(tmp_path):
    lines = session()
    at = next(k for k, line in enumerate(lines) if ' 1A0#' in line)
    named = [f'{lines[at].split()[0]} can0 {frame} R' for frame in NAME_UPLOAD]
    path = logged(tmp_path / 'a<script>alert(2)&.log', [*lines[:at], *named, *lines[at:]])
    page = check_alone(page_of(report_of(path)))
    assert '<script>alert(1)' in page.texts  # The page shows the device's name as text, not as markup.
    assert any('a<script>alert(2)&.log' in text for text in page.texts)
    assert page.tags.count('polygon') == 2  # Each of the two pads shows the outline of one touch.


def test_the_page_of_nothing_says_so(tmp_path):
    """If the log does not show a fact, the page reports neither a count of 0 nor that all is well."""
    lines = [line for line in session(1.0) if ' 080#' not in line]
    page = check_alone(page_of(report_of(logged(tmp_path / 'x.log', lines))))
    assert page.texts.count(ABSENT_TEXT) >= 8
    assert not any('Every taxel had a value' in text for text in page.texts)


def test_a_bag_of_taxel_arrays(tmp_path):
    folder = bag(tmp_path / 'bag', [('/left/taxels', message) for message in frames()],
                 topics=(('/left/taxels', TAXELS), ('/left/shape', 'tactile_skin/msg/ContactShape')))
    report = reported(folder)
    pad, = report.pads
    assert (pad.name, pad.frames, pad.incomplete, pad.lost_frames) == ('left', 30, 15, 1)
    touch, = pad.touches
    assert touch.contact.shape == 'square' and touch.is_open and touch.begin == pytest.approx(BEGIN + 0.2)
    assert touch.contact.force == pytest.approx(25 * 60e3 * 0.004**2, rel=1e-3)
    assert pad.health.by_status[TaxelStatus.STALE, 0, 1] == 15 and pad.health.by_status[TaxelStatus.DEAD, 0, 0] == 30
    assert report.recording.kind is Kind.TOPICS and report.recording.end == pytest.approx(BEGIN + 0.58)
    assert report.nodes is None and report.bus.can_frames is None and report.bus.load is None
    assert pad.counts is None and pad.layout is None
    found = {each.finding: each.number for each in findings(report)}
    assert found == {Remark.LOST_FRAMES: 1, Remark.INCOMPLETE: 15, Remark.FAULTY_TAXELS: 1}
    texts = check_alone(page_of(report)).texts
    assert texts.count(ABSENT_TEXT) >= 8


def test_diagnostics_of_another_program_are_not_reported_as_the_driver_s(tmp_path):
    kinds = store().types
    header = kinds['std_msgs/msg/Header'](kinds['builtin_interfaces/msg/Time'](BEGIN, 0), '')
    status = kinds['diagnostic_msgs/msg/DiagnosticStatus'](2, 'camera', 'fell over', '', [])
    messages = [('/left/taxels', message) for message in frames(3)]
    messages.append(('/diagnostics', kinds[DIAGNOSTICS](header, [status])))
    report = reported(bag(tmp_path / 'bag', messages, topics=(('/left/taxels', TAXELS), ('/diagnostics', DIAGNOSTICS))))
    assert report.bus.reported is None and 'fell over' not in page_of(report)


def test_what_the_driver_reports_is_escaped(tmp_path):
    record = StatusRecord()
    record.feed(BEGIN, status(level=3, message='<img src=x onerror=alert(3)>'))
    report = reported(bag(tmp_path / 'bag', [('/left/taxels', message) for message in frames(3)]))
    report = replace(report, bus=record.bus())
    change, = report.bus.reported
    assert change.is_problem and (Remark.REPORTED, 1) in {(each.finding, each.number) for each in findings(report)}
    assert any('<img src=x' in text for text in check_alone(page_of(report)).texts)


class Plug:
    """A recogniser that reports a taught shape for every contact."""

    def recognise(self, contact, visibility=None):
        return Recognition.certain(TaughtShape('my_plug') if contact.mask.any() else Shape.NONE)


def test_shapes_that_were_taught_are_named_and_drawn(tmp_path):
    path = tmp_path / 'session.log'
    path.write_text('\n'.join(session()) + '\n')
    page = page_of(report_of(path, node_ids=(32,), recogniser=Plug()))
    assert '<b>1. my plug</b>' in page and f'stroke="{TAUGHT_COLOUR}"' in page and '</i>my plug<' in page


def test_a_model_that_is_missing_is_an_error(tmp_path, capsys):
    assert main(['report', str(SESSION), '-o', str(tmp_path / 'x.html'), '--model', 'no_such.npz']) == 2
    assert 'no_such.npz' in capsys.readouterr().err and not (tmp_path / 'x.html').exists()


def test_the_command_writes_a_whole_page_or_none(tmp_path, capsys):
    log, out = logged(tmp_path / 'x.log', session(2.5)), tmp_path / 'report.html'
    assert main(['report', log, '--node-id', '32', '--pads', '<left>', '--bitrate', '500000', '-o', str(out)]) == 0
    shown = capsys.readouterr()
    # The command prints no progress, because its output is not a terminal.
    assert str(out) in shown.out and not shown.err
    page = check_alone(out.read_text(encoding='utf-8'))
    assert 'Pad <left>' in ''.join(page.texts)
    before = out.read_bytes()
    assert main(['report', str(tmp_path / 'none.log'), '-o', str(out), '--force']) == 2
    assert out.read_bytes() == before and list(tmp_path.glob('.report*')) == []
    content = (tmp_path / 'x.log').read_bytes()
    assert main(['report', log, '-o', log, '--force']) == 2
    assert (tmp_path / 'x.log').read_bytes() == content


@pytest.mark.slow
def test_the_command_names_the_problems_that_it_counts(tmp_path, capsys):
    log, out = logged(tmp_path / 'x.log', session(2.5)), tmp_path / 'report.html'
    assert main(['report', log, '--node-id', '32,96', '--pads', 'left,right', '-o', str(out)]) == 0
    first, *problems = capsys.readouterr().out.splitlines()
    assert first.endswith(f' {len(problems)} problems')
    assert any('right: this recording contains no taxels' in problem for problem in problems)
    texts = ''.join(check_alone(out.read_text(encoding='utf-8')).texts)
    assert all(problem.strip() in texts for problem in problems)


def test_a_bag_is_distinguished_from_a_log_by_its_topics(tmp_path, capsys, monkeypatch):
    monkeypatch.setitem(sys.modules, 'rclpy', None)
    folder = bag(tmp_path / 'bag', [('/left/taxels', message) for message in frames(12)])
    assert main(['report', str(folder), '-o', str(tmp_path / 'a.html')]) == 0
    assert '1 pad, 1 touch, ' in capsys.readouterr().out
