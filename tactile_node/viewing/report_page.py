"""The report as one HTML page: no script, and nothing from elsewhere."""

from string import Template

from tactile_node.logs.damage import damage_lines, utc
from tactile_node.viewing.bus_section import bus_section, nodes_section, pad_section
from tactile_node.viewing.charts import Html, facts, joined, paragraph, safe
from tactile_node.viewing.findings import findings, sentence
from tactile_node.viewing.model import Report

STYLE = '''body { font: 14px/1.45 system-ui, sans-serif; max-width: 68em;
 margin: 1.5em auto; padding: 0 1em; color: #222 }
h1 { font-size: 22px; margin-bottom: .2em } h2 { margin-top: 1.6em; border-bottom: 2px solid #0072b2; font-size: 19px }
h3 { font-size: 15px; margin: 1.2em 0 .3em } h4 { font-size: 13px; margin: .8em 0 .2em } small, .note { color: #666 }
.note { font-size: 12px; margin: .2em 0 } table { border-collapse: collapse; font-size: 13px; margin: .4em 0 }
td, th { padding: .15em .7em .15em 0; text-align: left; vertical-align: top } thead th { border-bottom: 1px solid #999 }
tbody tr:nth-child(even) { background: #f6f7f9 } .facts th { color: #666; font-weight: normal; white-space: nowrap }
.facts td { overflow-wrap: anywhere } .absent { color: #999; font-style: italic }
.cards { display: flex; flex-wrap: wrap; gap: 14px; margin: .6em 0 } figure { margin: 0; padding: 8px; width: 206px;
border: 1px solid #dde; border-radius: 6px; background: #fff; break-inside: avoid } figure .facts { font-size: 12px }
figure tbody tr:nth-child(even) { background: none } svg { display: block; margin: 4px 0 } .share { float: right }
svg text { font-size: 11px; fill: #555 } .chart { width: 100%; height: auto } .chart .tick { stroke: #e4e6ea }
.legend span { margin-right: 1.2em; font-size: 12px; white-space: nowrap } .legend i { display: inline-block;
width: 11px; height: 11px; border-radius: 2px; margin-right: 5px; vertical-align: -1px; border: 1px solid #ccc }
ul.findings { padding: 0; list-style: none } .findings li, .problem { padding: .35em .7em; margin: .25em 0;
border-left: 4px solid #7aa7c7; background: #f3f8fc } .findings li.problem, p.problem { border-color: #c1121f;
background: #fdf1f1 } summary { cursor: pointer; color: #0b5f96 } details { margin: .4em 0 }'''
PAGE = Template('''<!DOCTYPE html>
<html lang="en"><head><meta charset="utf-8"><title>Tactile report: $name</title>
<meta http-equiv="Content-Security-Policy" content="default-src 'none'; style-src 'unsafe-inline'">
<style>$style</style></head><body>
<h1>Tactile report: $name</h1>
$body
</body></html>
''')


def page_of(report: Report) -> str:
    """Return the page. All that comes from the recording is escaped."""
    begin, end = report.recording.begin, report.recording.end
    parts = [_recording(report), _findings(report), *(pad_section(pad, begin, end) for pad in report.pads),
             bus_section(report.bus, begin, end), nodes_section(report.nodes, begin),
             Html('<h2>Made by</h2>'), facts(report.versions)]
    return PAGE.substitute(style=STYLE, name=safe(report.recording.name), body=joined(parts))


def _recording(report: Report) -> Html:
    recording = report.recording
    unread = 'all of it'
    if recording.unread:
        unread = f'all but {recording.unread} lines, messages or rests, the last: {recording.problem}'
    return facts([
        ('begin', utc(recording.begin)), ('end', utc(recording.end)),
        ('duration', f'{recording.end - recording.begin:.2f} s'), ('holds', recording.kind.value),
        ('size', f'{recording.size} bytes'), ('SHA-256', recording.sha256 or 'several files have none'),
        ('read', unread),
        *(('missing', line) for line in damage_lines(recording.damages))])


def _findings(report: Report) -> Html:
    found = findings(report)
    if not found:
        return joined([Html('<h2>What stands out</h2>'), paragraph('Nothing, as far as this recording shows.')])
    rows = ''.join(f'<li class="{"problem" if each.finding.is_problem else "hint"}">{safe(sentence(each))}</li>'
                   for each in found)
    return Html(f'<h2>What stands out</h2><ul class="findings">{rows}</ul>')
