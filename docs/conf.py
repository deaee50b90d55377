"""Sphinx: `make docs` builds this folder; rosdoc2 runs a copy of this file from a folder above its copy of this one."""

import sys
import warnings
from pathlib import Path

import tactile_node  # both put the checkout on the path

ROOT = Path(tactile_node.__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT / 'docs/_ext'))
PAGES = '' if Path('_ext').is_dir() else 'docs/'  # Sphinx reads this file in the folder that it builds

# A number that an example could not compute ends the build: else the warning, with a path, stands on its page.
warnings.filterwarnings('error', category=RuntimeWarning, module='tactile_node')

project = 'tactile_skin'
author = copyright = 'tactile_skin maintainers'
release = version = tactile_node.__version__
root_doc = 'index'
exclude_patterns = [f'{PAGES}_ext', f'{PAGES}README.md', '_build']  # index.rst includes README.md

extensions = ['myst_parser', 'sphinx.ext.autodoc', 'sphinx.ext.napoleon', 'sphinx_gallery.gen_gallery', 'from_code']
myst_heading_anchors = 4  # links to headings, as GitHub has them
html_theme = 'sphinx_rtd_theme'
html_theme_options = {'navigation_depth': 3, 'collapse_navigation': False}
html_show_sourcelink = False
html_static_path = [f'{PAGES}_static']
html_css_files = ['site.css']
default_role = 'code'  # docstrings have single backquotes
highlight_language = 'none'  # of indented blocks: commands, diagrams and files

autodoc_typehints = 'signature'
autodoc_typehints_format = 'short'
autodoc_member_order = 'bysource'
autodoc_preserve_defaults = True
napoleon_google_docstring = False
napoleon_use_param = False  # types such as `float (rows, cols)` are text, not links
napoleon_use_rtype = False
nitpicky = True
#: what no page of ours documents: other libraries, for which nothing is downloaded, and parts of our own inside
nitpick_ignore_regex = [('py:.*', r'(numpy|np|scipy|matplotlib|pathlib|collections|typing|enum|os)\..*'),
                        ('py:.*', r'(ArrayLike|Path|ndarray|NDArray|Axes|Any|Iterator|Mapping|Sequence|Callable)'),
                        ('py:.*', r'tactile_node\..*')]

sphinx_gallery_conf = {
    'examples_dirs': [str(ROOT / 'examples/science')],
    'gallery_dirs': [f'{PAGES}gallery'],
    'filename_pattern': r'\.py$',          # all of them are run
    'abort_on_example_error': True,
    'download_all_examples': False,
    'show_signature': False,
    'capture_repr': (),
    'write_computation_times': False,
    'remove_config_comments': True,
}

#: rosdoc2 removes other extensions than its own unless it is allowed to keep those that are installed
rosdoc2_settings = {'allow_other_extensions': True}
