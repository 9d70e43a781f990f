"""The page of the command line, made from the commands' own help at every build.

Typer writes the help of all commands as Markdown; here its lists of options become tables and its examples
blocks of code.
"""

from __future__ import annotations

import html
import re
import subprocess
import sys
from typing import Any

from mkdocs.structure.files import File, Files

PAGE = "reference/command_line.md"
_COMMAND = [sys.executable, "-m", "typer", "groundpose.cli.main", "utils", "docs", "--name", "groundpose"]
_HEAD = """# Command line

Made from the commands' own help at every build of this page; `groundpose COMMAND --help` prints the same.

"""
_LEFT_OUT = re.compile(r"^\* `--(?:help|install-completion|show-completion)`.*\n", re.MULTILINE)
_BOLD = re.compile(r'<span style="font-weight: bold">(.*?)</span>')
_EXAMPLES = re.compile(r"^Examples?\n+((?:^  \S.*\n+)+)", re.MULTILINE)
_LIST = re.compile(
    r"^\*\*(?P<title>Arguments|Options|Commands)\*\*:\n\n(?P<items>(?:^\* .*\n)*)", re.MULTILINE
)
_ITEM = re.compile(
    r"^\* `(?P<names>[^`]*?)(?: (?P<value><[^>`]*>|\{?[A-Z][^`]*))?`: (?P<text>.*?)(?:  \[(?P<rest>.*)\])?$"
)


def on_files(files: Files, config: Any, **_: Any) -> Files:
    """Add the page."""
    files.append(File.generated(config, PAGE, content=page()))
    return files


def page() -> str:
    """The page as Markdown."""
    written = subprocess.run(_COMMAND, capture_output=True, text=True, check=True).stdout
    text = _LEFT_OUT.sub("", _BOLD.sub(_bold, html.unescape(written)))
    text = _LIST.sub(_table, _EXAMPLES.sub(_examples, text))
    return _HEAD + re.sub(
        r"^\*\*Usage\*\*:\n\n", "", text.replace("# `groundpose`", "## `groundpose`", 1), flags=re.M
    )


def _bold(found: re.Match[str]) -> str:
    """Names that are typed as code; a heading in the help stays a line of its own."""
    return found[1] if found[1].startswith("Example") else f"`{found[1]}`"


def _examples(found: re.Match[str]) -> str:
    lines = [line.strip() for line in found[1].splitlines() if line.strip()]
    return "\n".join(["```sh", *lines, "```", "", ""])


def _table(found: re.Match[str]) -> str:
    items = [_ITEM.match(line) for line in found["items"].splitlines()]
    if found["title"] == "Commands":
        return ""
    rows = [_row(item) for item in items if item is not None]
    if len(rows) != len(items):
        raise ValueError(f"help that cannot be read:\n{found['items']}")
    head = f"| {found['title'].lower()} | value | default | meaning |\n| --- | --- | --- | --- |\n"
    return head + "\n".join(rows) + "\n" if rows else ""


def _row(item: re.Match[str]) -> str:
    """`[default: X; required; x>=1]` at the end of an item speaks of its default and of its values."""
    default, limits = "", []
    for part in (item["rest"] or "").split("; "):
        if part.startswith("default: "):
            default = part.removeprefix("default: ")
        elif part == "required":
            default = part
        elif part:
            limits.append(part)
    default = re.sub(r"^\((.*)\)$", r"\1", default)
    value = ", ".join([*filter(None, [item["value"]]), *limits]).replace(" range>", ">")
    names = ", ".join(f"`{name}`" for name in re.split(r", | / ", item["names"]))
    cells = (names, f"`{value}`" if value else "", default, item["text"])
    return "| " + " | ".join(cell.replace("|", r"\|") for cell in cells) + " |"
