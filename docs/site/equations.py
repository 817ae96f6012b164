r"""Equations of the site: TeX to MathML when it is built, numbers as anchors, references as links.

``\tag{S1}`` numbers an equation; ``(S1)`` in the text of any page then leads there. Both read well
in the Markdown itself. An unknown number or TeX that cannot be converted fails the build.
"""

import html
import re
from pathlib import Path

from latex2mathml.converter import convert
from mkdocs.exceptions import PluginError

_TAG = re.compile(r"\\tag\{(\w+)\}")
_MATH = re.compile(
    r'<span class="arithmatex">\\\((.*?)\\\)</span>'
    r'|<div class="arithmatex">\s*\\\[(.*?)\\\]\s*</div>',
    re.DOTALL,
)
_REFERENCE = re.compile(r"\(([SLA]\d+)\)")
_NOT_TEXT = re.compile(r"(<(pre|code|math|h\d)\b.*?</\2>|<[^>]*>)", re.DOTALL)

_FUNCTION = re.compile(r"<mi>(sin|cos|tan|arcsin|tanh|ln|max|round|clip|sinc|cn|sn|am|Re)</mi>")
_SPACED = r'<mo lspace="0.17em" rspace="0.17em">\1</mo>'

_pages: dict[str, str] = {}
"""Where an equation is: page by number."""


def on_files(files, config):  # noqa: ANN001, ANN201 - MkDocs's own types
    """Find every equation's number before any page is made."""
    _pages.clear()
    for file in files.documentation_pages():
        for number in _TAG.findall(Path(file.abs_src_path).read_text(encoding="utf-8")):
            if number in _pages:
                raise PluginError(f"equation {number} is in {_pages[number]} and {file.url}")
            _pages[number] = file.url
    return files


def on_page_content(text, page, config, files):  # noqa: ANN001, ANN201
    """Convert a page's equations and link what refers to one."""
    here = page.file.url

    def equation(found: re.Match[str]) -> str:
        inline, block = found.groups()
        source = html.unescape(inline or block).strip()
        tags = _TAG.findall(source)
        formula = _mathml(_TAG.sub("", source), here, block=inline is None)
        if inline is not None:
            return formula
        number = f'<span class="number">({tags[0]})</span>' if tags else ""
        anchor = f' id="eq-{tags[0]}"' if tags else ""
        return f'<div class="equation"{anchor}><div class="formula">{formula}</div>{number}</div>'

    def reference(found: re.Match[str]) -> str:
        number = found[1]
        if number not in _pages:
            raise PluginError(f"{here}: there is no equation ({number})")
        target = "" if _pages[number] == here else _pages[number]
        return f'<a href="{target}#eq-{number}">({number})</a>'

    parts = _NOT_TEXT.split(_MATH.sub(equation, text))
    if any("$$" in part or "\\tag{" in part for part in parts[::3]):
        raise PluginError(f"{here}: an equation without an empty line before and after it")
    # In turn: text, what is no text, and the name of the element if it is one.
    for i in range(0, len(parts), 3):
        parts[i] = _REFERENCE.sub(reference, parts[i])
    return "".join(part for i, part in enumerate(parts) if i % 3 != 2)


def _mathml(source: str, page: str, *, block: bool) -> str:
    """Return TeX as MathML; what the converter does not know it leaves standing, which is seen."""
    try:
        formula = convert(source, display="block" if block else "inline")
    except Exception as error:
        raise PluginError(f"{page}: {source}: {error!r}") from error
    if "\\" in formula or "<mi>&</mi>" in formula:
        raise PluginError(f"{page}: TeX that is not converted: {source}")
    # As TeX sets it: a little space around the name of a function.
    return _FUNCTION.sub(_SPACED, formula)
