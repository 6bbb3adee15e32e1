"""The flat top-level folders are one import namespace, and importing stays light."""

import subprocess
import sys
from pathlib import Path

import pytest

import diff4splat

ROOT = Path(__file__).parents[2]
MOUNTED = ("models", "data_prep", "training", "configs")


def run_python(code: str, *flags: str) -> subprocess.CompletedProcess:
    """Run ``code`` in a fresh interpreter."""
    return subprocess.run(
        [sys.executable, *flags, "-c", code], capture_output=True, text=True, cwd=ROOT, check=False
    )


@pytest.mark.parametrize("folder", MOUNTED)
def test_a_mounted_folder_imports_under_its_public_name(folder: str) -> None:
    assert (
        run_python(
            f"import diff4splat.{folder} as m; assert m.__name__ == 'diff4splat.{folder}'"
        ).returncode
        == 0
    )


@pytest.mark.parametrize("folder", MOUNTED)
def test_a_mounted_folder_refuses_its_bare_name(folder: str) -> None:
    done = run_python(f"import {folder}")
    assert done.returncode != 0
    assert f"import 'diff4splat.{folder}'" in done.stderr


@pytest.mark.parametrize("folder", MOUNTED)
def test_the_link_for_static_tools_is_relative(folder: str) -> None:
    link = ROOT / "diff4splat" / folder
    assert link.is_symlink()
    assert link.readlink() == Path("..") / folder


@pytest.mark.parametrize("module", ["diff4splat", "diff4splat.cli.main"])
def test_importing_pulls_in_no_heavy_library(module: str) -> None:
    heavy = ("torch", "cv2", "matplotlib", "numpy")
    done = run_python(f"import {module}, sys; print([m for m in {heavy} if m in sys.modules])")
    assert done.stdout.strip() == "[]", done.stdout + done.stderr


def test_every_public_name_resolves() -> None:
    for name in diff4splat.__all__:
        assert getattr(diff4splat, name) is not None


def test_the_version_is_the_one_in_the_project_file_and_the_changelog() -> None:
    assert f'version = "{diff4splat.__version__}"' in (ROOT / "pyproject.toml").read_text()
    assert f"## {diff4splat.__version__}" in (ROOT / "CHANGELOG.md").read_text()
