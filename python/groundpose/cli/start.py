"""The `groundpose` command."""

from __future__ import annotations

import signal
import sys

from groundpose.cli.commands import COMMANDS, app_of
from groundpose.cli.output import on_any_terminal


def main() -> None:
    """Run the command line. SIGTERM ends it as Ctrl-C does: what is finished is put in its place."""
    on_any_terminal()
    signal.signal(signal.SIGTERM, _interrupt)
    asked = sys.argv[1:2]
    app_of(asked if asked and asked[0] in COMMANDS else COMMANDS)()


def _interrupt(*_: object) -> None:
    signal.signal(signal.SIGTERM, signal.SIG_IGN)  # a second one shall not disturb the end
    raise KeyboardInterrupt
