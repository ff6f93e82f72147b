"""The report as one self-contained HTML page."""

from __future__ import annotations

from html import escape
from typing import Final

from motionserver.evaluate.html import cards, document
from motionserver.evaluate.tune.preset import preset_name, preset_text
from motionserver.evaluate.tune.report import facts
from motionserver.evaluate.tune.result import TuneResult
from motionserver.evaluate.tune.space import Parameter
from motionserver.evaluate.tune.tables import Table, tables, trials_table, verdict

_WIDTH: Final = 300
_HEIGHT: Final = 190
_EDGE: Final = 34
_STYLE: Final = """
.dots{display:flex;flex-wrap:wrap;gap:12px}.dots svg{width:300px;height:190px;font:11px system-ui}
.dots text{fill:var(--soft)}.dots .name{fill:var(--ink);font-weight:600}
.dots path{stroke:var(--line);fill:none}.dot{fill:var(--c1);opacity:.75}
.out{fill:var(--c0);opacity:.5}
.was{fill:none;stroke:var(--c2);stroke-width:2.5}.now{fill:none;stroke:var(--good);stroke-width:2.5}
td:first-child{white-space:nowrap}pre{overflow-x:auto;font:13px ui-monospace,monospace;margin:0}
"""


def to_html(result: TuneResult) -> str:
    """The whole page; it needs nothing but itself."""
    title, *more = facts(result)
    said = "".join(f"<p>{escape(line)}.</p>" for line in verdict(result))
    parts = "".join(table_html(table) for table in tables(result))
    dots = "".join(_dots(result, parameter) for parameter in result.settings.space)
    return document(
        title,
        _STYLE,
        "".join(f'<p class="soft">{escape(line)}.</p>' for line in more)
        + f"{_cards(result)}{said}{parts}<h2>Every trial</h2>"
        '<p class="soft">Mean score over each tunable: blue in the running, grey out of it, orange '
        f'ring the default, green ring the choice.</p><div class="frame dots">{dots}</div>'
        f"{table_html(trials_table(result))}<h2>{escape(preset_name(result))}.toml</h2>"
        f'<div class="frame"><pre>{escape(preset_text(result))}</pre></div>'
        f'<h2>Again</h2><div class="frame"><pre>{escape(result.command)}</pre></div>',
    )


def _cards(result: TuneResult) -> str:
    held, default = result.held_out_score, result.score(result.default)
    shown = [
        (f"{default:.3f}", "with the defaults", ""),
        (
            f"{held:.3f}",
            "leave-one-out: on drives not looked at",
            "good" if result.pays else "poor",
        ),
        (f"{result.score(result.final.trial):.3f}", "in-sample: on the drives chosen on", ""),
        (
            f"{result.held_out_violations}",
            "violations of hard limits by the choices",
            "poor" if result.held_out_violations else "good",
        ),
    ]
    return cards(shown)


def table_html(table: Table) -> str:
    """One table with its heading and note."""
    head = "".join(f"<th>{escape(cell)}</th>" for cell in table.head)
    rows = "".join(
        "<tr>" + "".join(f"<td>{escape(cell)}</td>" for cell in row) + "</tr>" for row in table.rows
    )
    note = f'<p class="soft">{escape(table.note)}</p>' if table.note else ""
    return (
        f'<h2>{escape(table.title)}</h2>{note}<div class="frame"><table><thead><tr>{head}</tr>'
        f"</thead><tbody>{rows}</tbody></table></div>"
    )


def _dots(result: TuneResult, parameter: Parameter) -> str:
    """Mean score of every trial over one tunable, in its own scale."""
    scores = [result.score(trial) for trial in result.trials]
    low, high = min(scores), max(scores)
    room = max(high - low, 1e-9)

    def place(value: float | str, score: float) -> str:
        x = _EDGE + parameter.share(value) * (_WIDTH - _EDGE - 12)
        y = 24 + (1.0 - (score - low) / room) * (_HEIGHT - 24 - _EDGE)
        return f'cx="{x:.1f}" cy="{y:.1f}"'

    out = [
        f'<svg viewBox="0 0 {_WIDTH} {_HEIGHT}" role="img"><text class="name" x="4" y="13">'
        f"{escape(parameter.name)}</text>"
        f'<path d="M{_EDGE} 18V{_HEIGHT - _EDGE + 6}H{_WIDTH - 6}"/>'
        f'<text x="2" y="28">{high:.3f}</text>'
        f'<text x="2" y="{_HEIGHT - _EDGE + 4}">{low:.3f}</text>'
    ]
    marks = parameter.choices or tuple(f"{parameter.at(share):.3g}" for share in (0.0, 0.5, 1.0))
    for index, mark in enumerate(marks):
        share = (index + 0.5) / len(marks) if parameter.choices else index / 2.0
        x = _EDGE + share * (_WIDTH - _EDGE - 12)
        out.append(
            f'<text x="{x:.0f}" y="{_HEIGHT - 8}" text-anchor="middle">{escape(mark)}</text>'
        )
    for trial, score in zip(result.trials, scores, strict=True):
        kind = "out" if result.objection(trial) else "dot"
        out.append(
            f'<circle class="{kind}" r="3.5" {place(trial.values[parameter.name], score)}>'
            f"<title>trial {trial.number}: {score:.4f}</title></circle>"
        )
    for kind, trial in (("was", result.default), ("now", result.final.trial)):
        at = place(trial.values[parameter.name], scores[trial.number])
        out.append(f'<circle class="{kind}" r="6" {at}/>')
    return "".join(out) + "</svg>"
