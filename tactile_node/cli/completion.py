"""`tactile completion` prints shell code for TAB completion of the commands, options and file names of `tactile`.

bash:  echo 'eval "$(tactile completion bash)"' >> ~/.bashrc
zsh:   echo 'autoload -U compinit && compinit; eval "$(tactile completion zsh)"' >> ~/.zshrc
fish:  tactile completion fish > ~/.config/fish/completions/tactile.fish
"""

import argparse
from collections.abc import Mapping

import argcomplete

SHELLS = 'bash', 'zsh', 'fish'


def add_options(parser: argparse.ArgumentParser) -> None:
    parser.add_argument('shell', choices=SHELLS, help='shell for which the code is printed')


def run(args: argparse.Namespace) -> int:
    print(argcomplete.shellcode(['tactile'], shell=args.shell))
    return 0


def chosen_command(environment: Mapping[str, str]) -> str:
    """Return the sub-command on the command line, or '' while the user is still typing it.

    >>> chosen_command({'COMP_LINE': 'tactile classify --pi', 'COMP_POINT': '21', '_ARGCOMPLETE': '1'})
    'classify'
    >>> chosen_command({'COMP_LINE': 'tactile cla', 'COMP_POINT': '11', '_ARGCOMPLETE': '1'})
    ''
    """
    line = environment.get('COMP_LINE', '')[:int(environment.get('COMP_POINT') or 0)]
    words = line.split()[int(environment.get('_ARGCOMPLETE') or 1):]
    return words[0] if words and len(line.split(words[0], 1)[1]) else ''
