"""The command line with all its commands."""

from __future__ import annotations

from groundpose.cli.commands import COMMANDS, app_of

app = app_of(COMMANDS)
