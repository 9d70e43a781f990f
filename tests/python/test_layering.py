"""Data flows one way and so do imports: a room uses only rooms above it in the list, files never in a circle,
and what `import groundpose` users carry never imports the laboratory."""

import ast
from collections.abc import Iterator
from pathlib import Path

import groundpose
import pytest

PACKAGE = Path(groundpose.__file__).parent

# From the ground to the roof. A room is a file or a folder of the package; "" is `groundpose` itself.
ROOMS = (
    *("_core", "_checks", "_npz", "_writing", "_live", "_value", "lens", "calibration", "options", "types"),
    *("plausibility", "shape", "_given", "vehicles", "remarks", "poses", "sizes", "frame", "camera_state"),
    *("road", "tracking", "world", "traffic", "draw", "formats", "estimator", "estimate"),
    *("camera_profile", "self_calibration"),
    *("keypoints", "detector", "fleet", "", "demo", "cli"),
    *(
        "lab",
        "lab.data",
        "lab.metrics",
        "lab.processes",
        "lab.timing",
        "lab.targets",
        "lab.bodies",
        "lab.drive",
        "lab.training",
        "lab.contenders",
        "lab.evaluate",
        "lab.bench",
    ),
)
# Imports that go the other way, with the reason. They run inside a function, when somebody asks for it.
DOORS = {
    ("poses", "formats.kitti.results"): "PoseBatch.to_kitti: a result writes itself in the usual format",
    ("types", "formats.calibrations"): "Camera.from_file: a camera reads itself from any format",
    ("poses", "draw"): "PoseBatch.draw: a result shows itself",
    ("poses", "formats.arrow_poses"): "PoseBatch.to_arrow: a result is a table of Arrow",
    (
        "poses",
        "formats.neighbours.supervision",
    ): "PoseBatch.to_supervision: a result in the terms of a library",
    (
        "vehicles",
        "lab.bodies",
    ): "vehicles.body and its like: public names whose code only the laboratory needs",
}
# Commands of the laboratory: they import what they run inside the command.
COMMANDS = ("simulate", "crops", "train", "bench", "experiment", "evaluate", "evaluate_sets", "evaluate_lab")


def name_of(path: Path) -> str:
    """A file as its module is called below `groundpose`: "formats.frames", "draw" for draw/__init__.py."""
    parts = path.relative_to(PACKAGE).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


FILES = {name_of(path): path for path in sorted(PACKAGE.rglob("*.py"))} | {"_core": PACKAGE / "_core.pyi"}


def room(name: str) -> str:
    parts = name.split(".")
    return ".".join(parts[:2]) if parts[0] == "lab" else parts[0]


def own(module: str) -> str | None:
    """The name below `groundpose` of one of our modules, else None."""
    first, _, rest = module.partition(".")
    return rest if first == "groundpose" and rest in FILES else None


def imports(name: str) -> set[tuple[str, bool]]:
    """The modules of ours that a file imports, each with whether it waits for a call."""
    text = FILES[name].read_text("utf-8")
    named = set(inside(ast.parse(text), "import_module(" in text))
    return {(to, lazy) for to, lazy in named if to != name}


def inside(node: ast.AST, texts: bool, lazy: bool = False) -> Iterator[tuple[str, bool]]:
    """The imports below a node; with `texts` also each str that names a module, for `import_module`."""
    for child in ast.iter_child_nodes(node):
        if (
            isinstance(child, ast.If)
            and isinstance(child.test, ast.Name)
            and child.test.id == "TYPE_CHECKING"
        ):
            continue
        if isinstance(child, ast.Constant) and texts and isinstance(child.value, str):
            yield from ((to, True) for to in [own(child.value)] if to)
        for module in modules(child):
            to = own(module)
            if to is not None:
                yield to, lazy
        yield from inside(child, texts, lazy or isinstance(child, (ast.FunctionDef, ast.AsyncFunctionDef)))


def modules(node: ast.AST) -> list[str]:
    if isinstance(node, ast.Import):
        return [alias.name for alias in node.names]
    if isinstance(node, ast.ImportFrom):
        assert node.level == 0, "imports are absolute"
        each = [f"{node.module}.{alias.name}" for alias in node.names]
        return [full if own(full) else str(node.module) for full in each]
    return []


IMPORTS = {name: set() if name == "_core" else imports(name) for name in FILES}


def is_door(name: str, to: str) -> bool:
    if (name, to) in DOORS or (
        name == "" and room(to) in ("keypoints", "detector")
    ):  # the front door opens its rooms late
        return True
    return room(name) == "cli" and name.removeprefix("cli.") in COMMANDS and room(to).startswith("lab")


def test_every_file_has_a_room():
    assert {room(name) for name in FILES} == set(ROOMS)


@pytest.mark.parametrize("name", FILES, ids=lambda name: name or "groundpose")
def test_a_file_uses_only_rooms_above_its_own(name):
    place = ROOMS.index(room(name))
    wrong = {to for to, _ in IMPORTS[name] if ROOMS.index(room(to)) > place and not is_door(name, to)}
    assert not wrong, f"{name} imports what stands on it"


def test_what_goes_the_other_way_waits_until_it_is_asked_for():
    used = {(name, to) for name in FILES for to, _ in IMPORTS[name]}
    assert set(DOORS) <= used, "a door that nobody uses"
    early = {
        (name, to)
        for name in FILES
        for to, lazy in IMPORTS[name]
        if not lazy and ROOMS.index(room(to)) > ROOMS.index(room(name))
    }
    assert not early


def test_the_runtime_never_imports_the_laboratory():
    found = {
        (name, to)
        for name in FILES
        for to, _ in IMPORTS[name]
        if not room(name).startswith("lab") and room(to).startswith("lab") and not is_door(name, to)
    }
    assert not found


def test_files_do_not_import_each_other_in_a_circle():
    below = {name: {to for to, _ in IMPORTS[name] if not is_door(name, to)} for name in FILES}
    while leaves := {name for name, needs in below.items() if not needs}:
        below = {name: needs - leaves for name, needs in below.items() if name not in leaves}
    assert not below, "these files need each other"
