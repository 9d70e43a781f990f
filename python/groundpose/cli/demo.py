"""`groundpose demo`: from a bundled image of a street to poses."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from groundpose.cli.inputs import NetworkFile
from groundpose.cli.output import console, mistakes, show


def demo(
    out: Annotated[Path, typer.Option(help="Picture to write (.png, .svg, .pdf).")] = Path(
        "groundpose_demo.png"
    ),
    network: NetworkFile = None,
) -> None:
    """From a bundled image of a street to poses: print estimate and truth, write a picture.

    [bold]Examples[/bold]

      groundpose demo

      groundpose demo --network mine.onnx --out /tmp/street.png
    """
    from groundpose.demo import run
    from groundpose.draw import check_path

    with mistakes():
        check_path(out)
        result = run(network)
        console().print(result.table())
        result.write_picture(out)
    show(f"Picture: {out.resolve()}")
