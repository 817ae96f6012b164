"""HTML from the templates beside this module: whatever is no markup of theirs is escaped."""

from __future__ import annotations

from collections.abc import Callable
from importlib.resources import files

from jinja2 import Environment, PackageLoader, StrictUndefined
from markdown_it import MarkdownIt
from markupsafe import Markup

from dualbend.report.section import Details, Figure, Panels, Verdict, Warned
from dualbend.table import Code, Table


def render(name: str, **values: object) -> str:
    """Return a template of this package with values put into it, each escaped."""
    environment = Environment(
        loader=PackageLoader("dualbend.report"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.policies["json.dumps_kwargs"] = {"allow_nan": False}
    for kind in (Table, Code, Figure, Panels, Details, Verdict, Warned, Markup):
        environment.tests[kind.__name__.lower()] = _is_a(kind)
    return environment.get_template(name).render(**values)


def _is_a(kind: type) -> Callable[[object], bool]:
    return lambda value: isinstance(value, kind)


def markdown(text: str) -> Markup:
    """Return Markdown as HTML without its heading; a link to another page is text only.

    It would lead nowhere from a page that stands alone.
    """
    parser = MarkdownIt("commonmark", {"html": False})
    for kind in ("link_open", "link_close"):
        parser.add_render_rule(kind, lambda *_: "")
    tokens = parser.parse(text)
    if tokens and tokens[0].type == "heading_open":
        del tokens[:3]
    return Markup(parser.renderer.render(tokens, parser.options, {}))


def asset(name: str, tag: str) -> Markup:
    """Return a style or script that stands beside this module, to go inside ``tag``."""
    return inside(files("dualbend.report").joinpath(name).read_text(encoding="utf-8"), tag)


def inside(text: str, tag: str) -> Markup:
    """Return a style or script as it is; what would end ``tag`` early is broken up."""
    return Markup(text.replace(f"</{tag}", f"<\\/{tag}"))
