"""What the command line says, and where the estimates go: JSON lines, KITTI text, a table, pictures."""

from __future__ import annotations

import re
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import IO, Any, NoReturn

import numpy as np
import typer
from numpy.typing import NDArray
from rich.box import SIMPLE_HEAD
from rich.console import Console
from rich.table import Table

from groundpose._checks import FloatArray
from groundpose._core import InputError
from groundpose.draw import check_path
from groundpose.formats.frames import Frame, FrameObject
from groundpose.formats.records import pose_record
from groundpose.poses import Pose, PoseBatch

FORMATS = ("jsonl", "kitti", "table")


@dataclass(frozen=True)
class Style:
    """How results are written: `record` makes the JSON line of a frame and its poses, `kitti_type` names an
    object in KITTI's text."""

    record: Callable[[Frame, Any], str] = pose_record
    kitti_type: Callable[[FrameObject], str] = lambda item: item.model


def console(stderr: bool = False, file: IO[str] | None = None) -> Console:
    """A console for now: streams may be redirected between two commands (as tests do).

    Files and pipes have no width: tables are as wide there as they need to be.
    """
    made = Console(stderr=stderr, file=file, highlight=False, markup=False, soft_wrap=stderr)
    return (
        made
        if made.is_terminal
        else Console(stderr=stderr, file=file, highlight=False, markup=False, soft_wrap=stderr, width=160)
    )


def complain(message: object) -> None:
    """One line on standard error."""
    console(stderr=True).print(f"error: {message}", style="red")


def refuse(message: object) -> NoReturn:
    """A mistake of the user: one line, exit status 2."""
    complain(message)
    raise typer.Exit(2)


@contextmanager
def mistakes() -> Iterator[None]:
    """Errors that are the user's to solve become one line and exit status 2, never a traceback."""
    try:
        yield
    except BrokenPipeError:
        raise  # the reader of our output has enough; see `estimate`
    except OSError as error:
        refuse(f"{error.filename or 'file'}: {error.strerror or error}")
    except (InputError, TypeError) as error:
        refuse(error)


_PLAIN = Style()


class Output:
    """Where estimates go, written and flushed frame by frame."""

    def __init__(self, out: Path | None, form: str, several: bool, style: Style = _PLAIN) -> None:
        """Open the file; a usage error if the frames do not fit it."""
        self.form, self.out, self.style = form, out, style
        self.folder: Path | None = None
        self.file: IO[str] = sys.stdout
        if form == "kitti" and several:
            if out is None or (out.exists() and not out.is_dir()):
                refuse("--format kitti: one file holds one frame; for several give a folder, -o FOLDER")
            out.mkdir(parents=True, exist_ok=True)
            self.folder = out
        elif out is not None:
            if out.is_dir():
                refuse(f"-o {out}: is a folder; give a file in it")
            self.file = out.open("w", encoding="utf-8")

    def write(self, frame: Frame, poses: PoseBatch) -> None:
        """One frame; complete on the disk or in the pipe when this returns."""
        if self.folder is not None:
            path = self.folder / f"{file_stem(frame.id)}.txt"
            path.write_text(self._kitti(frame, poses), encoding="utf-8")
            return
        if self.form == "table":
            console(file=self.file).print(frame_table(frame, poses))
        elif self.form == "kitti":
            self.file.write(self._kitti(frame, poses))
        else:
            self.file.write(self.style.record(frame, poses) + "\n")
        self.file.flush()

    def _kitti(self, frame: Frame, poses: PoseBatch) -> str:
        """With the detector's scores where all objects have one."""
        scores = [o.score for o in frame.objects if o.score is not None]
        types = [self.style.kitti_type(o) for o in frame.objects]
        return poses.to_kitti(types, scores if len(scores) == len(types) else None)

    @property
    def on_terminal(self) -> bool:
        """Whether the results are shown on a terminal."""
        return self.folder is None and self.file.isatty()

    def close(self) -> None:
        """Close the file, if it is ours."""
        if self.file is not sys.stdout:
            self.file.close()


class Pictures:
    """`--draw`: one picture per frame."""

    def __init__(self, path: Path, several: bool) -> None:
        """A usage error if it is no picture's name, or several frames would overwrite one picture."""
        try:
            check_path(path)
        except InputError as error:
            refuse(f"--draw: {error}")
        if several and "{id}" not in path.name:
            refuse("--draw: several frames need {id} in the name, as in --draw 'frame_{id}.png'")
        self.path = path

    def write(self, frame: Frame, poses: PoseBatch, image: NDArray[np.uint8] | None = None) -> None:
        """Draw one frame over `image`, or over the one it names, if it names one."""
        if image is None and frame.image is not None:
            from groundpose.keypoints.image import as_rgb  # with Pillow, which few runs need

            image = as_rgb(frame.image)
        path = self.path.with_name(self.path.name.replace("{id}", file_stem(frame.id)))
        if frame.image is not None and path.resolve() == frame.image.resolve():
            raise InputError(f"{path}: is the image; give the picture another name")
        path.parent.mkdir(exist_ok=True)
        poses.draw(image, path, truth=frame.truth)


def file_stem(label: str | int) -> str:
    """A frame's id as a file name: numbers with six digits as KITTI has them, no separators."""
    return f"{label:06d}" if isinstance(label, int) else re.sub(r"[^\w.-]", "_", label).lstrip(".") or "_"


def frame_table(frame: Frame, poses: PoseBatch) -> Table:
    """The poses of one frame, with errors where the truth is known."""
    table = Table(
        title=f"Frame {frame.id}",
        title_justify="left",
        box=SIMPLE_HEAD,
        padding=(0, 1, 0, 0),
        show_edge=False,
    )
    for name in ("object", "model", "status"):
        table.add_column(name, no_wrap=True)
    truth = frame.truth
    for name in ("x, z (m)", "yaw (°)", "inliers", "rms px", "± m", *(["error"] if truth else [])):
        table.add_column(name, justify="right", no_wrap=True)
    ground = poses.view.R_camera_from_ground
    for i, (item, pose) in enumerate(zip(frame.objects, poses, strict=True)):
        row = [str(item.id), item.model, pose.status, *_numbers(pose, ground)]
        if truth:
            row.append(_error(pose, truth[0][i], truth[1][i]))
        table.add_row(*row, style="" if pose.ok else "dim")
    return table


def _numbers(pose: Pose, ground: FloatArray) -> list[str]:
    seen = int(np.isfinite(pose.keypoints_2d).all(axis=1).sum())
    if not pose.ok:
        return ["-", "-", f"-/{seen}", "-", "-"]
    x, _, z = ground.T @ pose.t
    spread = float(np.sqrt(np.trace(pose.covariance[3:, 3:])))
    return [
        f"{x:.2f}, {z:.2f}",
        f"{np.degrees(pose.yaw):.1f}",
        f"{pose.inlier_count}/{seen}",
        f"{pose.reprojection_rmse:.2f}",
        "-" if np.isnan(spread) else f"{spread:.2f}",
    ]


def _error(pose: Pose, R: FloatArray, t: FloatArray) -> str:
    if not pose.ok or np.isnan(t).any():
        return "-"
    angle = np.degrees(np.arccos(np.clip(0.5 * (np.sum(pose.R * R) - 1.0), -1.0, 1.0)))
    return f"{np.linalg.norm(pose.t - t):.2f} m {angle:.1f}°"
