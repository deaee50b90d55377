"""Sphinx configuration for `make docs` and rosdoc2.

`make docs` builds the pages in the folder of this file. rosdoc2 copies this file to the parent folder of its copy of
docs/, and runs Sphinx there.
"""

import warnings
from pathlib import Path

import tactile_node  # `make docs` and rosdoc2 put the root of the repository on the path.

ROOT = Path(tactile_node.__file__).resolve().parents[1]
PAGES = '' if Path('_static').is_dir() else 'docs/'  # Sphinx runs this file in the folder that it builds.

# A warning about an invalid number stops the build. Otherwise the warning and a local path would appear on the page.
warnings.filterwarnings('error', category=RuntimeWarning, module='tactile_node')

project = 'tactile_skin'
author = copyright = 'tactile_skin maintainers'
release = version = tactile_node.__version__
root_doc = 'index'
exclude_patterns = [f'{PAGES}README.md', '_build']  # index.rst includes README.md

extensions = ['myst_parser', 'sphinx_gallery.gen_gallery']
myst_heading_anchors = 4  # Generate the same heading anchors as GitHub.
html_theme = 'sphinx_rtd_theme'
html_theme_options = {'navigation_depth': 3, 'collapse_navigation': False}
html_show_sourcelink = False
html_static_path = [f'{PAGES}_static']
html_css_files = ['site.css']
default_role = 'code'  # Our docstrings mark code with single backquotes.
highlight_language = 'none'  # Indented blocks contain commands, diagrams and files.

sphinx_gallery_conf = {
    'examples_dirs': [str(ROOT / 'examples/science')],
    'gallery_dirs': [f'{PAGES}gallery'],
    'filename_pattern': r'\.py$',          # Run every example.
    'abort_on_example_error': True,
    'download_all_examples': False,
    'show_signature': False,
    'capture_repr': (),
    'write_computation_times': False,
    'remove_config_comments': True,
}

#: Without this setting, rosdoc2 removes all extensions except its own.
rosdoc2_settings = {'allow_other_extensions': True}
