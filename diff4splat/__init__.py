"""One image, a camera path and optional text to an explicit, deformable 3D Gaussian scene.

Public names are imported on first use, so ``import diff4splat`` stays light.
"""

from importlib import import_module

__version__ = "0.1.0"

_PUBLIC = {
    "Camera": "diff4splat.geometry.camera",
    "CameraPath": "diff4splat.paths.camera_path",
    "Diff4SplatPipeline": "diff4splat.generation.pipeline",
    "Gaussians": "diff4splat.scene.gaussians",
    "KeyframeMotion": "diff4splat.scene.motion.keyframes",
    "Scene": "diff4splat.scene.scene",
    "StaticMotion": "diff4splat.scene.motion.static",
    "load_scene": "diff4splat.io.scene_files.scene_file",
    "save_scene": "diff4splat.io.scene_files.scene_file",
}

__all__ = ["__version__", *sorted(_PUBLIC)]  # noqa: PLE0604 (the names are strings)


def __getattr__(name: str) -> object:
    if name not in _PUBLIC:
        raise AttributeError(f"module 'diff4splat' has no attribute {name!r}")
    return getattr(import_module(_PUBLIC[name]), name)


def __dir__() -> list[str]:
    return __all__
