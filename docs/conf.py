"""How Sphinx makes the site: the pages as they are, notebooks with their results, the public names.

`scripts/build_docs` runs it over the root of the repository, so that pages link to each other and to code as they do
there.
"""

import os
import posixpath
import re
import tomllib
from importlib import import_module
from inspect import isroutine
from pathlib import Path
from typing import Any

from docutils import nodes
from docutils.utils.math import latex2mathml
from numpy.typing import ArrayLike
from sphinx import addnodes
from sphinx.application import Sphinx
from sphinx.util.osutil import relative_uri
from sphinx.util.typing import stringify_annotation

ROOT = Path(__file__).resolve().parent.parent
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]

project = "swarm_forage_env"
author = PROJECT["authors"][0]["name"]
version = release = PROJECT["version"]

extensions = ["myst_nb", "sphinx.ext.autodoc", "sphinx.ext.napoleon", "sphinx.ext.intersphinx"]
root_doc = "README"
include_patterns = ["*.md", "docs/**", "swarm_forage_env/policies/pretrained/*.md"]
exclude_patterns = [".*", "build", "dist", "results", "**/__pycache__", "**/.*"]

myst_enable_extensions = ["dollarmath"]
myst_fence_as_directive = ["math"]
myst_heading_anchors = 4
# A notebook that fails, or takes longer, ends the build.
nb_execution_mode = "force"
nb_execution_in_temp = True
os.environ["RESULTS"] = str(Path(__file__).parent / "results")  # for the notebook that reads them
nb_execution_show_tb = True
nb_execution_timeout = 1200  # seconds for a cell; slow machines and cold kernels need some
nb_merge_streams = True

# Docstrings are Google style; `name` in them is code.
default_role = "code"
napoleon_numpy_docstring = False
napoleon_use_ivar = True
autodoc_default_options = {"members": True}
autodoc_member_order = "bysource"
autodoc_typehints_format = "short"
autodoc_preserve_defaults = True
python_use_unqualified_type_names = True
python_maximum_signature_line_length = 100
toc_object_entries_show_parents = "hide"

# Reading what other sites name needs a network: with scripts/build_docs --links only.
OTHER_SITES = {
    "python": ("https://docs.python.org/3", None),
    "numpy": ("https://numpy.org/doc/stable", None),
    "gymnasium": ("https://gymnasium.farama.org", None),
    "pettingzoo": ("https://pettingzoo.farama.org", None),
}
intersphinx_mapping = OTHER_SITES if tags.has("links") else {}  # noqa: F821 - Sphinx gives `tags` to this file
# A DOI leads elsewhere by design.
linkcheck_allowed_redirects = {r"https://doi\.org/.*": r".*"}
linkcheck_timeout = 30

html_theme = "furo"
html_static_path = ["site.css"]
html_css_files = ["site.css"]
html_title = f"swarm_forage_env {release}"
html_copy_source = False
html_show_sphinx = False
html_show_copyright = False
html_math_renderer = "mathml"


COLON = "\ufdd0"
"""A code point that is no character, so that no docstring has it."""


ARRAY_LIKE = stringify_annotation(ArrayLike, "smart")
"""The union that this name stands for, as signatures show it: six lines of names that nobody types."""


def contents() -> str:
    """Return the table of contents as toctrees: the lists of docs/index.md under their headings, in that order."""
    trees = "\n```{toctree}\n:hidden:\n\nAll pages <docs/index.md>\n```\n"
    for section in (ROOT / "docs/index.md").read_text(encoding="utf-8").split("\n## ")[1:]:
        heading, text = section.split("\n", 1)
        links = [
            link for line in text.splitlines() if line.startswith("- ") for link in re.findall(r"\]\(([^)#]+)\)", line)
        ]
        pages = [posixpath.normpath(posixpath.join("docs", link)) for link in links]
        listed = "\n".join(page for page in pages if page != "README.md")
        if listed:
            trees += f"\n```{{toctree}}\n:hidden:\n:caption: {heading}\n\n{listed}\n```\n"
    return trees


def add_contents(_app: Sphinx, docname: str, source: list[str]) -> None:
    """Append the table of contents to the start page."""
    if docname == root_doc:
        source[0] += contents()


def full_name(page: str, name: str) -> str:
    """Return the full name of a public name as its page shows it."""
    ours = ("swarm_forage_env", "metrics", "baselines")
    package = "metrics" if page.endswith(("measures", "scoring")) else "swarm_forage_env"
    return name if name.startswith(tuple(f"{one}." for one in ours)) else f"{package}.{name}"


def add_docstrings(_app: Sphinx, docname: str, source: list[str]) -> None:
    """Append the docstrings of the names in the first column of the table of a page of public names."""
    if not docname.startswith("docs/api/"):
        return
    lines = []
    for names, text in re.findall(r"^\| (`.+?`) \| (.+?) \|$", source[0], re.MULTILINE):
        for name in re.findall(r"`([\w.]+)`", names):
            full = full_name(docname, name)
            module, _, attribute = full.rpartition(".")
            found = getattr(import_module(module), attribute)
            if isinstance(found, type):
                kind = "autoexception" if issubclass(found, Exception) else "autoclass"
                lines.append(f".. {kind}:: {full}")
            else:
                lines += (
                    [f".. autofunction:: {full}"] if isroutine(found) else [f".. data:: {full}", "", f"   {text}", ""]
                )
    source[0] += "\n```{eval-rst}\n" + "\n".join(lines) + "\n```\n"


def markdown_to_rst(_app: Sphinx, what: str, _name: str, _object: Any, _options: Any, lines: list[str]) -> None:
    """Let reStructuredText keep what it would misread in docstrings: tables stay as typed, a bar is a bar."""
    rows = [line.lstrip().startswith(("| ", "|-")) for line in lines]
    for number in reversed(range(len(lines))):
        if rows[number]:
            lines[number] = "   " + lines[number]
            if not (number and rows[number - 1]):
                lines[number:number] = ["::", ""]
        else:
            texts = lines[number].split("`")
            lines[number] = "`".join(text if odd % 2 else text.replace("|", r"\|") for odd, text in enumerate(texts))
    if what in ("attribute", "data", "property"):
        # napoleon would take what stands before a colon for a type.
        lines[0] = lines[0].replace(":", COLON)


def colons_back(_app: Sphinx, _what: str, _name: str, _object: Any, _options: Any, lines: list[str]) -> None:
    """Undo, after napoleon, what `markdown_to_rst` did to colons."""
    lines[:] = [line.replace(COLON, ":") for line in lines]


def name_arrays(
    _app: Sphinx, _what: str, _name: str, _object: Any, _options: Any, signature: str | None, returned: str | None
) -> tuple[str | None, str | None]:
    """Let signatures say ArrayLike, as the code does."""
    arguments, result = (text and text.replace(ARRAY_LIKE, "~numpy.typing.ArrayLike") for text in (signature, returned))
    return arguments, result


def open_replays(app: Sphinx, doctree: nodes.document, docname: str) -> None:
    """Let links to replays open them, where Sphinx would have the browser save the file."""
    here = app.builder.get_target_uri(docname)
    for node in list(doctree.findall(addnodes.download_reference)):
        if node.get("filename", "").endswith(".html"):
            target = relative_uri(here, f"_downloads/{node['filename']}")
            node.replace_self(nodes.reference("", "", *node.children, refuri=target))


def write_formula(translator: Any, node: nodes.math | nodes.math_block) -> None:
    """Write a formula as MathML, which browsers show without scripts from elsewhere."""
    as_block = isinstance(node, nodes.math_block)
    formula = latex2mathml.tex2mathml(node.astext(), as_block=as_block)
    translator.body.append(f'<div class="formula">{formula}</div>' if as_block else formula)
    raise nodes.SkipNode


def setup(app: Sphinx) -> None:
    """Connect what Sphinx does not do by itself."""
    app.connect("source-read", add_contents)
    app.connect("source-read", add_docstrings)
    app.connect("autodoc-process-docstring", markdown_to_rst, priority=400)  # before napoleon's 500
    app.connect("autodoc-process-docstring", colons_back, priority=600)
    app.connect("autodoc-process-signature", name_arrays)
    app.connect("doctree-resolved", open_replays)
    app.add_html_math_renderer("mathml", (write_formula, None), (write_formula, None))
