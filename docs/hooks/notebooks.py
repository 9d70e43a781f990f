"""Notebooks as pages: run at every build, so that what a page shows is what this version computes."""

from __future__ import annotations

import hashlib
from pathlib import Path
from typing import Any

import nbformat
from mkdocs.exceptions import PluginError
from mkdocs.structure.files import File, Files
from nbclient import NotebookClient
from nbclient.exceptions import CellExecutionError
from nbconvert import MarkdownExporter

FOLDER = Path(__file__).parents[1] / "notebooks"
_SECONDS_A_CELL = 120
_LINK = "\n\n[This page as a notebook]({name}.ipynb){{ .md-button download }}\n"
_made: dict[str, tuple[str, dict[str, bytes]]] = {}


def on_files(files: Files, config: Any, **_: Any) -> Files:
    """Add a page and its pictures for every notebook."""
    for path in sorted(FOLDER.glob("*.ipynb")):
        markdown, pictures = _run(path)
        place = f"{FOLDER.name}/{path.stem}"
        files.append(File.generated(config, f"{place}.md", content=markdown + _LINK.format(name=path.stem)))
        for name, content in pictures.items():
            files.append(File.generated(config, f"{FOLDER.name}/{name}", content=content))
    return files


def _run(path: Path) -> tuple[str, dict[str, bytes]]:
    """Markdown and pictures of a notebook; it runs again only when it changed (`mkdocs serve`)."""
    text = path.read_text(encoding="utf-8")
    key = hashlib.sha256(text.encode()).hexdigest()
    if key not in _made:
        notebook = nbformat.reads(text, as_version=4)
        place = {"metadata": {"path": path.parent}}
        client = NotebookClient(
            notebook, timeout=_SECONDS_A_CELL, resources=place, extra_arguments=["--log-level=ERROR"]
        )
        try:
            client.execute()
        except CellExecutionError as error:
            raise PluginError(f"{path.name}: {error}") from error
        resources = {"output_files_dir": f"{path.stem}_files", "unique_key": path.stem}
        markdown, resources = MarkdownExporter().from_notebook_node(notebook, resources)
        _made[key] = (markdown, resources["outputs"])
    return _made[key]
