"""`groundpose help`: how a command is used."""

from __future__ import annotations

from typing import Annotated

import typer


def show_help(
    command: Annotated[list[str] | None, typer.Argument(help="Of which command; none: all.")] = None,
) -> None:
    """Show how a command is used.

    [bold]Examples[/bold]

      groundpose help estimate

      groundpose help evaluate kitti
    """
    from groundpose.cli.main import app  # with all commands

    app([*(command or []), "--help"], prog_name="groundpose")
