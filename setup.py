"""Mount the flat top-level folders under one import namespace: models/ is diff4splat.models."""

from setuptools import find_packages, setup

MOUNTED = ("models", "training", "data_prep", "configs")

own = [
    name
    for name in find_packages(include=["diff4splat", "diff4splat.*"])
    if name.split(".")[1:2] not in [[folder] for folder in MOUNTED]
]
mounted = [
    f"diff4splat.{folder}{suffix}"
    for folder in MOUNTED
    for suffix in ["", *(f".{child}" for child in find_packages(folder))]
]
setup(
    packages=own + mounted,
    package_dir={"diff4splat": "diff4splat"}
    | {f"diff4splat.{folder}": folder for folder in MOUNTED},
)
