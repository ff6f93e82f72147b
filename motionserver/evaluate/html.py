"""What all pages of an evaluation share: frame, style, cards. Each is one file of its own."""

from __future__ import annotations

from collections.abc import Iterable
from html import escape
from typing import Final

STYLE: Final = """
:root{color-scheme:light dark;--paper:#fbfbfa;--card:#fff;--ink:#1d2430;--soft:#667085;
--line:#e3e6ea;--bad:#c8372d;--good:#12805c;--c0:#98a1b0;--c1:#2563c9;--c2:#d9730d;--c3:#159a6b;
--c4:#8b4fc4;--c5:#c2417c}
@media(prefers-color-scheme:dark){:root{--paper:#14171c;--card:#1b1f26;--ink:#e7eaf0;--soft:#98a2b3;
--line:#2c323c;--bad:#f0685e;--good:#4cc38a;--c0:#7f8a9c;--c1:#6ea8fe;--c2:#f5a04c;--c3:#4cc38a;
--c4:#b794f4;--c5:#f28fb5}}
*{box-sizing:border-box}
body{margin:0 auto;max-width:1060px;padding:32px 24px 64px;background:var(--paper);color:var(--ink);
font:15px/1.5 system-ui,-apple-system,"Segoe UI",sans-serif}
h1{font-size:26px;line-height:1.2;margin:0 0 4px}h2{font-size:18px;margin:40px 0 12px}
p{margin:6px 0}.soft{color:var(--soft)}code{font:13px ui-monospace,monospace}
.cards{display:flex;flex-wrap:wrap;gap:12px;margin:20px 0}
.card{flex:1 1 150px;background:var(--card);border:1px solid var(--line);border-radius:10px;
padding:12px 16px}.card b{display:block;font-size:26px;line-height:1.25;font-weight:650;
font-variant-numeric:tabular-nums}.card span{color:var(--soft);font-size:13px}
.good b{color:var(--good)}.poor b{color:var(--bad)}
.frame{background:var(--card);border:1px solid var(--line);border-radius:10px;padding:10px 12px;
margin:0 0 16px;overflow-x:auto}
table{border-collapse:collapse;width:100%;font-variant-numeric:tabular-nums}
th,td{padding:4px 12px;text-align:right;white-space:nowrap}
th:first-child,td:first-child{text-align:left;white-space:normal}
thead th{border-bottom:1px solid var(--line);font-size:13px}
tbody tr+tr td{border-top:1px solid var(--line)}
tbody th{padding-top:18px;font-size:13px;color:var(--soft);text-transform:none;text-align:left}
td.best{font-weight:700}td.bad{color:var(--bad);font-weight:700}
"""
"""Style of all pages: colours of day and night, cards, frames, tables."""


def document(title: str, style: str, body: str) -> str:
    """A whole page that needs nothing but itself.

    Args:
        title: Text; also the heading.
        style: Style sheet beside `STYLE`.
        body: Markup below the heading.
    """
    return (
        '<!doctype html><html lang="en"><head><meta charset="utf-8">'
        '<meta name="viewport" content="width=device-width,initial-scale=1">'
        f"<title>{escape(title)}</title><style>{STYLE}{style}</style></head><body>"
        f"<h1>{escape(title)}</h1>{body}</body></html>\n"
    )


def cards(shown: Iterable[tuple[str, str, str]]) -> str:
    """Cards side by side.

    Args:
        shown: Figure, what it is, and "good", "poor" or "" for its colour.
    """
    return (
        '<div class="cards">'
        + "".join(
            f'<div class="card {kind}"><b>{escape(value)}</b><span>{escape(text)}</span></div>'
            for value, text, kind in shown
        )
        + "</div>"
    )
