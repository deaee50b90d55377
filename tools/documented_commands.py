"""Print each command in the documents, with its requirements or the test that runs it: `make commands`.

If any line in an indented or fenced block of code begins with one of PROGRAMS, all lines in the block are commands.
Inline code is also a command if it begins with one of PROGRAMS. Inline commands are often incomplete, so the script
checks only the names in them.

A test fails if a command has no class in RULES, or if a command names an option, a file, a make target or a launch
argument that does not exist.
"""

import argparse
import re
import shlex
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

from command_rules import PROGRAMS, RULES, CommandKind, Rule

ROOT = Path(__file__).resolve().parents[1]


TESTED = (CommandKind.RUN, CommandKind.TESTED)
SHELL_WORDS = ('>', '>>', '<', '|', '&&', ';')


class DocumentedCommand(NamedTuple):
    page: str
    line: int
    text: str
    in_sentence: bool

    @property
    def words(self) -> list[str]:
        """The words of the first program on the line, up to the first shell operator."""
        words = shlex.split(self.text, comments=True)
        return words[:next((i for i, word in enumerate(words) if word in SHELL_WORDS), None)]

    @property
    def rule(self) -> Rule | None:
        found = next((rule for rule in RULES if re.search(rule.pattern, self.text)), None)
        return Rule('', CommandKind.CHECKED) if self.in_sentence and (found is None or found.kind in TESTED) else found


def pages() -> list[Path]:
    return [ROOT / 'README.md', ROOT / 'CONTRIBUTING.md', *sorted((ROOT / 'docs').rglob('*.md'))]


def commands() -> list[DocumentedCommand]:
    return [command for page in pages()
            for command in commands_of(page.read_text(encoding='utf-8'), str(page.relative_to(ROOT)))]


def commands_of(text: str, page: str) -> list[DocumentedCommand]:
    """Return the commands on a page, in the order of the page.

    >>> [(each.line, each.text) for each in commands_of('See `make test`:\\n\\n    make demo  # now\\n', 'a')]
    [(1, 'make test'), (3, 'make demo')]
    """
    blocks, prose = _blocks(text.splitlines())
    found = [DocumentedCommand(page, number, line, False) for block in blocks if any(map(_is_command, block.values()))
             for number, line in block.items()]
    for match in re.finditer(r'`([^`]+)`', '\n'.join(prose)):
        code = ' '.join(match[1].split())
        if ' ' in code and _is_command(code):
            found.append(DocumentedCommand(page, match.string.count('\n', 0, match.start()) + 1, code, True))
    return sorted(found, key=lambda command: command.line)


def _blocks(lines: list[str]) -> tuple[list[dict[int, str]], list[str]]:
    """Return the code blocks as {line number: joined line}, and the lines of the page with the code blocks blanked."""
    blocks: list[dict[int, str]] = [{}]
    prose, fence, depth = [], '', 0
    for number, line in enumerate(lines, 1):
        text = line.strip()
        indent = len(line) - len(line.lstrip())
        if re.match(r'(\d+\.|[-*]) ', text) and not fence:
            depth = indent + len(re.match(r'\S+ ', text)[0])  # column where the text of a list item begins
        elif text and not fence and indent == 0:
            depth = 0
        is_code = bool(fence) or indent >= depth + 4 and (not prose or not prose[-1].strip() or bool(blocks[-1]))
        if text.startswith('```'):
            fence = '' if fence else text[3:] or 'text'
            blocks.append({})
        elif is_code and text and fence in ('', 'sh', 'bash', 'console'):
            _add(blocks[-1], number, text)
        elif text:
            blocks.append({})
        prose.append('' if is_code or text.startswith('```') else line)
    return blocks, prose


def _add(block: dict[int, str], number: int, text: str) -> None:
    last = max(block, default=0)
    if last and block[last].endswith('\\'):
        block[last] = f'{block[last][:-1].strip()} {_plain(text)}'
    else:
        block[number] = _plain(text)


def _plain(text: str) -> str:
    """Return ``text`` without a trailing comment or `&`."""
    return re.sub(r'\s+(#.*|&)$', '', text).strip()


def _is_command(text: str) -> bool:
    return text.split(' ')[0] in PROGRAMS and not text.startswith('make:')


def problem(command: DocumentedCommand) -> str | None:
    """Return a description of an invalid name in the command, or None if all names are valid."""
    words = command.words
    if words[0] == 'tactile':
        return _problem_of_tactile(words[1:], command.in_sentence)
    if words[0] == 'make':
        targets = re.findall(r'^([\w-]+):', (ROOT / 'Makefile').read_text(encoding='utf-8'), re.MULTILINE)
        unknown = [word for word in words[1:] if '=' not in word and word not in targets]
        return f'no target {unknown}' if unknown else None
    if words[0].startswith('python') and words[1].endswith('.py') and not (ROOT / words[1]).is_file():
        return f'no file {words[1]}'
    if words[:3] == ['ros2', 'launch', 'tactile_skin']:
        if not (ROOT / 'launch' / words[3]).is_file():
            return f'no launch file {words[3]}'
        from tactile_node.cli.bringup import ARGUMENTS
        unknown = [word for word in words[4:] if ':=' in word and word.split(':=')[0] not in ARGUMENTS]
        return f'no launch argument {unknown}' if unknown else None
    return None


def _problem_of_tactile(words: list[str], in_sentence: bool) -> str | None:
    from tactile_node.cli.main import COMMANDS, _parser
    from tactile_node.errors import ConfigurationError
    if words[0] in ('COMMAND', '--version', '--help'):
        return None
    if words[0] not in [name for name, *_ in COMMANDS]:
        return f'no command {words[0]}'
    parser = _parser(words[0])
    parser.exit_on_error = False
    if not in_sentence:
        try:
            parser.parse_args(words)
        except (argparse.ArgumentError, ConfigurationError, SystemExit, ValueError) as error:
            return f'{error}'
        return None
    known = {option for below in _all_parsers(parser) for option in below._option_string_actions}
    unknown = [word for word in words if word.startswith('--') and word.split('=')[0] not in known]
    return f'no option {unknown}' if unknown else None


def _all_parsers(parser: argparse.ArgumentParser) -> Iterator[argparse.ArgumentParser]:
    yield parser
    for action in parser._actions:
        if isinstance(action, argparse._SubParsersAction):
            for below in action.choices.values():
                yield from _all_parsers(below)


def main() -> int:
    found = commands()
    for kind in CommandKind:
        chosen = [command for command in found if command.rule and command.rule.kind is kind]
        print(f'\n{kind.value}: {len(chosen)}')
        for command in chosen:
            where = f'  [{command.rule.where}]' if command.rule.where else ''
            print(f'  {command.page}:{command.line}: {command.text}{where}')
    bad = [command for command in found if command.rule is None or problem(command)]
    for command in bad:
        print(f'{command.page}:{command.line}: {command.text}: {problem(command) or "in no class"}', file=sys.stderr)
    print(f'\
{len(found)} commands, {len(bad)} of them with a problem')
    return 1 if bad else 0


if __name__ == '__main__':
    sys.exit(main())
