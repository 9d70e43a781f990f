"""Pages that stand at the root of the repository, and links between them and `docs/`.

A page keeps the links that work where the repository is browsed. On the site a link to another page leads
there, and a link to a file that is no page becomes the file's path. A path that does not exist stays a link,
which the strict build refuses.
"""

from __future__ import annotations

import posixpath
import re
from pathlib import Path
from typing import Any

from mkdocs.structure.files import File, Files

ROOT = Path(__file__).parents[2]
PAGES = {
    "README.md": "index.md",
    "ARCHITECTURE.md": "architecture.md",
    "CONTRIBUTING.md": "contributing.md",
    "CHANGELOG.md": "changelog.md",
}
"""Files of the repository's root and the pages that they are."""
_HIDE = {"index.md": "---\nhide: [navigation]\n---\n"}  # a section of one page
_SOURCES = {page: source for source, page in PAGES.items()}

_FENCED = re.compile(r"^( *)(```|~~~).*?^\1\2 *$", re.DOTALL | re.MULTILINE)
_LINK = re.compile(r"(?P<image>!?)\[(?P<text>[^\]]*)\]\((?P<target>[^)\s#:]+)(?P<anchor>#[^)\s]*)?\)")
_SOURCE = re.compile(r'(?<=\bsrc=")(?P<target>[^":]+)(?=")')


def on_files(files: Files, config: Any, **_: Any) -> Files:
    """Add the pages of the root."""
    for source, page in PAGES.items():
        if (ROOT / source).exists():
            text = _HIDE.get(page, "") + (ROOT / source).read_text(encoding="utf-8")
            files.append(File.generated(config, page, content=text))
    return files


def on_page_markdown(markdown: str, page: Any, **_: Any) -> str:
    """Turn the links outside blocks of code."""
    parts, end = [], 0
    for block in _FENCED.finditer(markdown):
        parts += [_turned(markdown[end : block.start()], page.file.src_uri), block.group()]
        end = block.end()
    return "".join([*parts, _turned(markdown[end:], page.file.src_uri)])


def _turned(text: str, page: str) -> str:
    text = _SOURCE.sub(lambda found: _on_site(found["target"], page) or found["target"], text)
    return _LINK.sub(lambda found: _link(found, page), text)


def _link(found: re.Match[str], page: str) -> str:
    target = _on_site(found["target"], page)
    if target is not None:
        return f"{found['image']}[{found['text']}]({target}{found['anchor'] or ''})"
    path = _in_repository(found["target"], page)
    if found["image"] or not (ROOT / path).exists():
        return found.group()
    text = found["text"]
    return f"`{path}`" if text.strip("`") in (path, found["target"]) else f"{text} (`{path}`)"


def _in_repository(target: str, page: str) -> str:
    """The path in the repository that a link of a page leads to."""
    folder = "" if page in _SOURCES else posixpath.join("docs", posixpath.dirname(page))
    return posixpath.normpath(posixpath.join(folder, target))


def _on_site(target: str, page: str) -> str | None:
    """The same link on the site, relative to the page; None where it leads to no page and no picture."""
    path = _in_repository(target, page)
    place = PAGES.get(path) or (path.removeprefix("docs/") if path.startswith("docs/") else None)
    if place is None:
        return None
    return posixpath.relpath(place, posixpath.dirname(page) or ".")
