"""What would be installed: every module of every folder, and nothing at the top level but ours."""

import runpy
from pathlib import Path

import pytest
import setuptools

ROOT = Path(__file__).parents[2]
MOUNTED = ("models", "data_prep", "training", "configs")


def packages(monkeypatch: pytest.MonkeyPatch) -> tuple[set[str], dict[str, str]]:
    """What setup.py hands to setuptools."""
    handed = {}
    monkeypatch.setattr(setuptools, "setup", handed.update)
    monkeypatch.chdir(ROOT)
    runpy.run_path("setup.py")
    return set(handed["packages"]), handed["package_dir"]


def test_every_folder_with_modules_is_a_package(monkeypatch: pytest.MonkeyPatch) -> None:
    expected = {"diff4splat"}
    for area in (ROOT / "diff4splat").iterdir():
        if area.is_dir() and not area.is_symlink() and area.name != "__pycache__":
            expected |= {
                dotted(folder) for folder in [area, *area.rglob("*")] if has_modules(folder)
            }
    for name in MOUNTED:
        mounted = ROOT / name
        below = {dotted(folder) for folder in [mounted, *mounted.rglob("*")] if has_modules(folder)}
        expected |= {f"diff4splat.{package}" for package in below}
    found, directories = packages(monkeypatch)
    assert found == expected
    assert directories["diff4splat.models"] == "models"


def test_nothing_else_lands_in_site_packages(monkeypatch: pytest.MonkeyPatch) -> None:
    found, _ = packages(monkeypatch)
    assert {name.split(".")[0] for name in found} == {"diff4splat"}


def has_modules(folder: Path) -> bool:
    return folder.is_dir() and any(folder.glob("*.py"))


def dotted(folder: Path) -> str:
    return ".".join(folder.relative_to(ROOT).parts)
