"""The names of the recognition methods; apart from them, so that a command line knows them at once."""

LEARNED, VOLF = 'learned', 'volf'
DEFAULT = LEARNED
FILES = {LEARNED: 'recogniser.npz', VOLF: 'volf_curves.yaml'}  #: what each reads by default, in config/
