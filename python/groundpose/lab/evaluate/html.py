"""Pages of one file: tables, pictures and curves as HTML that needs nothing else, not even a network."""

from __future__ import annotations

import base64
import html
import io
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from groundpose._writing import write_text

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Row = dict[str, Any]
_STYLE = """
body{font:15px/1.45 system-ui,sans-serif;max-width:1260px;margin:2rem auto;padding:0 1rem;color:#1a1a1a}
h1{font-size:1.6rem;margin-bottom:.2rem}h2{font-size:1.2rem;margin-top:2.2rem;border-bottom:1px solid #ddd}
h3{font-size:1rem;margin:1.4rem 0 .3rem}p.note,figcaption{color:#555;max-width:52rem}
code{background:#f4f4f4;padding:.1rem .3rem;word-break:break-word}
.wide{overflow-x:auto}table{border-collapse:collapse;font-size:12.5px;font-variant-numeric:tabular-nums}
th,td{padding:.22rem .45rem;text-align:right;border-bottom:1px solid #e8e8e8;white-space:nowrap}
th{vertical-align:bottom;white-space:normal;font-weight:600;max-width:6.5rem}
th:first-child,td:first-child{text-align:left;max-width:none}
tr:hover td{background:#f7f9fc}figure{margin:1rem 0}img,svg{max-width:100%;height:auto}
"""


def page(title: str, parts: Iterable[str]) -> str:
    """A whole document."""
    body = "\n".join(parts)
    return (
        '<!DOCTYPE html>\n<html lang="en"><head><meta charset="utf-8">'
        '<meta name="viewport" content="width=device-width, initial-scale=1">'
        f"<title>{html.escape(title)}</title><style>{_STYLE}</style></head>\n"
        f"<body>\n<h1>{html.escape(title)}</h1>\n{body}\n</body></html>\n"
    )


def text(tag: str, content: str, kind: str = "") -> str:
    """One element; its content is plain text."""
    attribute = f' class="{kind}"' if kind else ""
    return f"<{tag}{attribute}>{html.escape(content)}</{tag}>"


def table(rows: Sequence[Row]) -> str:
    """Rows with the same keys, those in the order in which they first appear; numbers to three digits."""
    columns = list(dict.fromkeys(key for row in rows for key in row))
    head = "".join(text("th", column) for column in columns)
    lines = ["".join(text("td", _cell(row.get(column))) for column in columns) for row in rows]
    body = "".join(f"<tr>{line}</tr>" for line in lines)
    return f'<div class="wide"><table><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table></div>'


def _cell(value: Any) -> str:
    if value is None:
        return "–"
    if isinstance(value, list):
        return " / ".join(_cell(item) for item in value)
    if isinstance(value, float):
        return f"{value:.0f}" if abs(value) >= 1000 else f"{value:.3g}"
    return str(value)


def figure(drawn: Figure, caption: str, form: str = "svg") -> str:
    """A figure of matplotlib, as "svg" or (pictures) "png", inside the page."""
    import matplotlib as mpl

    stream = io.BytesIO()
    # without a date and with names that are no accident the same numbers give the same page
    with mpl.rc_context({"svg.hashsalt": "groundpose"}):
        drawn.savefig(stream, format=form, dpi=100, metadata={"Date": None} if form == "svg" else None)
    kind = {"svg": "image/svg+xml", "png": "image/png"}[form]
    data = base64.b64encode(stream.getvalue()).decode("ascii")
    alternative = html.escape(caption, quote=True)
    picture = f'<img alt="{alternative}" src="data:{kind};base64,{data}">'
    return f"<figure>{picture}{text('figcaption', caption)}</figure>"


def write(folder: Path, content: str) -> Path:
    """The page as `index.html` of a folder."""
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / "index.html"
    write_text(path, content)
    return path
