"""HTML made of parts that are escaped unless they are HTML already."""

from __future__ import annotations

import html
import re
from collections.abc import Iterable, Sequence

_VOID = frozenset({"meta", "hr", "br"})


class Html(str):
    """Text that is HTML; everything else is escaped where it is put into an element."""

    __slots__ = ()


def element(tag: str, *content: str, **attributes: str | None) -> Html:
    """Return an element; ``class_`` is class, ``aria_label`` aria-label; None leaves one out."""
    shown = "".join(
        f' {name.rstrip("_").replace("_", "-")}="{html.escape(value)}"'
        for name, value in attributes.items()
        if value is not None
    )
    if tag in _VOID:
        return Html(f"<{tag}{shown}>")
    return Html(f"<{tag}{shown}>{join(content)}</{tag}>")


def join(parts: Iterable[str]) -> Html:
    """Return the parts in a row, escaped where they are plain text."""
    return Html("".join(p if isinstance(p, Html) else html.escape(p, quote=False) for p in parts))


def table(
    caption: str, head: Sequence[str], rows: Iterable[Sequence[str]], numeric: Sequence[int] = ()
) -> Html:
    """Return a table; columns in ``numeric`` are aligned to the right, the first names its row."""
    classes = ["num" if i in numeric else None for i in range(len(head))]
    heads = [
        element("th", text, scope="col", class_=c) for text, c in zip(head, classes, strict=True)
    ]
    body = [
        element(
            "tr",
            element("th", row[0], scope="row"),
            *(element("td", cell, class_=c) for cell, c in zip(row[1:], classes[1:], strict=True)),
        )
        for row in rows
    ]
    inner = element(
        "table",
        element("caption", caption),
        element("thead", element("tr", *heads)),
        element("tbody", *body),
    )
    # A wide table scrolls by itself; the page does not.
    return element("div", inner, class_="scroll", tabindex="0", role="region", aria_label=caption)


def figure(identifier: str, caption: str, alt: str) -> Html:
    """Return a picture with its caption and, for who does not see it, what it shows."""
    shown = element("div", id=identifier, class_="plot", role="img", aria_label=alt)
    return element("figure", shown, element("figcaption", caption))


def markdown(text: str) -> Html:
    """Return the little Markdown that the limitations are written in: paragraphs and lists.

    ``**bold**``, code and links; a link to another page of the documentation is text only, since
    it would lead nowhere. The heading is left out.
    """
    blocks: list[Html] = []
    for block in re.split(r"\n\s*\n", text):
        if block.startswith("#") or not block.strip():
            continue
        if block.lstrip().startswith("* "):
            items = re.split(r"^\* ", block.strip(), flags=re.MULTILINE)[1:]
            blocks.append(element("ul", *(element("li", _inline(item)) for item in items)))
        else:
            blocks.append(element("p", _inline(block)))
    return join(blocks)


def _inline(text: str) -> Html:
    plain = html.escape(" ".join(text.split()), quote=False)
    plain = re.sub(r"`([^`]+)`", r"<code>\1</code>", plain)
    plain = re.sub(r"\*\*(.+?)\*\*", r"<strong>\1</strong>", plain)
    return Html(re.sub(r"\[([^\]]+)\]\([^)]+\)", r"\1", plain))
