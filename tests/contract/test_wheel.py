"""What would be installed: every module of every folder, and nothing at the top level but ours."""

import runpy
import shutil
from pathlib import Path

import pytest
import setuptools
from setuptools.dist import Distribution

ROOT = Path(__file__).parents[2]
MOUNTED = ("models", "data_prep", "training", "configs")
SHIPPED = ("config.json", "provenance.json", "vae.safetensors", "SHA256SUMS", "CARD.md")


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


def test_weights_and_protocols_are_installed_as_data(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in ("setup.py", "pyproject.toml", "README.md", "LICENSE"):
        shutil.copy(ROOT / name, tmp_path)
    weights, protocols = "models/weights/small", "diff4splat/evaluation/protocols"
    expected = {f"{weights}/{name}" for name in SHIPPED} | {f"{protocols}/held_out_v1.json"}
    modules = [f"{name}/__init__.py" for name in ("diff4splat", *MOUNTED, "diff4splat/evaluation")]
    for name in [*expected, *modules, f"{protocols}/__init__.py"]:
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).touch()
    assert data_files(tmp_path, monkeypatch) == expected


def data_files(project: Path, monkeypatch: pytest.MonkeyPatch) -> set[str]:
    """Everything but modules that setuptools would install, by its place in the project."""
    handed = {}
    monkeypatch.setattr(setuptools, "setup", handed.update)
    monkeypatch.chdir(project)
    runpy.run_path("setup.py")
    distribution = Distribution(handed)
    distribution.parse_config_files()
    assert distribution.include_package_data is False  # else folders of data count as packages
    build = distribution.get_command_obj("build_py")
    build.ensure_finalized()
    listed = build.data_files
    return {str(Path(folder, name)) for _, folder, _, names in listed for name in names}


def has_modules(folder: Path) -> bool:
    return folder.is_dir() and any(folder.glob("*.py"))


def dotted(folder: Path) -> str:
    return ".".join(folder.relative_to(ROOT).parts)
