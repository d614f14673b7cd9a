"""Words of others stay words in Markdown: a parser that lets HTML through finds none of its own marks in them."""

from __future__ import annotations

import html
from string import printable

import pytest
from markdown_it import MarkdownIt

from aug3d_core.run.errors import UsageError
from aug3d_core.view.markdown import literal, told


@pytest.mark.parametrize(
    "text",
    [
        '<iframe srcdoc="<img src=x onerror=parent.document.title=1337>">_DSC1_.jpg',
        "<script>alert(1)</script>",
        "![a](/etc/passwd)",
        "[a](javascript:alert(1))",
        "&lt;b&gt; &#60;i>",
        "# a",
        "1. a",
        "- a",
        "    a",
        "`<b>`",
        "a\n\n<b>\n===",
        "a | b\n--|--\nc | d",
        "ends in \\",
        "Grüße ~~from~~ 東京 _x_ **y**",
        "".join(printable.split()),
    ],
)
def test_a_text_is_shown_as_it_is(text: str) -> None:
    rendered = MarkdownIt("commonmark", {"html": True}).enable(["table", "strikethrough"]).render(literal(text))
    shown = rendered.strip().removeprefix("<p>").removesuffix("</p>")
    assert "<" not in shown and html.unescape(shown) == " ".join(text.split())


def test_an_error_is_told_with_what_to_do() -> None:
    assert told(UsageError("no_port", "take <9>")) == r"no\_port\: take \<9\>"
    assert told(MemoryError("no *room*")) == r"MemoryError\: no \*room\*"
