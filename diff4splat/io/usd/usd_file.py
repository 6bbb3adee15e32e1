"""OpenUSD with a ``ParticleField3DGaussianSplat`` prim (26.03 on): the only file that imports pxr.

Axes: ``n`` Gaussians, ``k`` harmonics. The prim ``/Scene/Gaussians`` holds our numbers in our axes;
``/Scene`` turns them half a turn about x, to y up. Whatever changes has time samples, between which
OpenUSD interpolates by itself: positions on lines, orientations by slerp. ``/Scene/Camera`` is the
scene's camera path. Time codes are seconds × ``TIME_CODES_PER_S``.
"""

from collections.abc import Sequence
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import torch

from diff4splat import __version__
from diff4splat.errors import FileFormatError, MissingExtraError
from diff4splat.io.splats.require_finite import require_finite
from diff4splat.scene.gaussians import Gaussians
from diff4splat.scene.scene import Scene

TIME_CODES_PER_S = 24.0
GAUSSIANS, CAMERA = "/Scene/Gaussians", "/Scene/Camera"
SCHEMA = "ParticleField3DGaussianSplat"
_APERTURE_MM = 36.0
"""Width of the film gate, of which only the ratio to the focal length matters."""


def require_usd() -> None:
    """Refuse where usd-core is absent or has no Gaussians yet.

    Raises:
        MissingExtraError: it is not installed, or too old.
    """
    if not hasattr(_pxr("UsdVol"), SCHEMA):
        raise MissingExtraError(
            "OpenUSD: expected version 26.03 or newer, got an older one; pip install -U usd-core"
        )


def write_usd(scene: Scene, file: Path, times_s: Sequence[float]) -> None:
    """Write the states at ``times_s`` to a new file, as text or binary by its ending.

    Raises:
        InputError: a value is NaN, infinite or beyond float32.
        MissingExtraError: as ``require_usd``.
    """
    require_usd()
    usd, geom, vol = _pxr("Usd"), _pxr("UsdGeom"), _pxr("UsdVol")
    stage = usd.Stage.CreateNew(str(file))
    stage.SetMetadata("comment", f"diff4splat {__version__}")
    geom.SetStageUpAxis(stage, geom.Tokens.y)
    stage.SetTimeCodesPerSecond(TIME_CODES_PER_S)
    stage.SetStartTimeCode(times_s[0] * TIME_CODES_PER_S)
    stage.SetEndTimeCode(times_s[-1] * TIME_CODES_PER_S)
    root = geom.Xform.Define(stage, "/Scene")
    root.AddRotateXOp().Set(180.0)
    stage.SetDefaultPrim(root.GetPrim())
    field = vol.ParticleField3DGaussianSplat.Define(stage, GAUSSIANS).GetPrim()
    _write_states(field, scene, times_s, file)
    _write_camera(geom.Camera.Define(stage, CAMERA), scene)
    stage.GetRootLayer().Save()


def _write_states(prim: Any, scene: Scene, times_s: Sequence[float], file: Path) -> None:
    """Attributes that differ from the first state get a sample for every time."""
    first, before = None, None
    sampled: set[str] = set()
    lows, highs = [], []
    for time_s in times_s:
        state = scene.state_at(time_s)
        require_finite(state, str(file))
        before = _arrays(state, before)
        first = first or before
        sampled |= {name for name in before if not np.array_equal(before[name], first[name])}
        reach = 3 * state.scales.amax(-1, keepdim=True)
        lows.append((state.means - reach).amin(0))
        highs.append((state.means + reach).amax(0))
    extent = torch.stack([torch.stack(lows).amin(0), torch.stack(highs).amax(0)]).float().numpy()
    _set(prim, "extent", extent)
    prim.GetAttribute("radiance:sphericalHarmonicsDegree").Set(scene.gaussians.degree)
    for name in first or {}:
        if name not in sampled:
            _set(prim, name, first[name])
    before = None
    for time_s in times_s if sampled else ():
        before = _arrays(scene.state_at(time_s), before)
        for name in sampled:
            _set(prim, name, before[name], time_s * TIME_CODES_PER_S)


def _arrays(state: Gaussians, before: dict[str, np.ndarray] | None) -> dict[str, np.ndarray]:
    """By attribute; quaternions (x, y, z, w) on the side of those ``before``."""
    quats = torch.nn.functional.normalize(state.quats.double(), dim=-1).roll(-1, 1).numpy()
    if before is not None:
        quats = np.where((quats * before["orientations"]).sum(1, keepdims=True) < 0, -quats, quats)
    return {
        "positions": _plain(state.means),
        "orientations": quats.astype("f4"),
        "scales": _plain(state.scales),
        "opacities": _plain(state.opacities),
        "radiance:sphericalHarmonicsCoefficients": _plain(state.sh.flatten(0, 1)),
    }


def _plain(values: torch.Tensor) -> np.ndarray:
    return values.detach().float().contiguous().numpy()


def _set(prim: Any, name: str, values: np.ndarray, time_code: float | None = None) -> None:
    vt, usd = _pxr("Vt"), _pxr("Usd")
    kinds = {1: vt.FloatArray, 3: vt.Vec3fArray, 4: vt.QuatfArray}
    kind = kinds[1 if values.ndim == 1 else values.shape[1]]
    time = usd.TimeCode.Default() if time_code is None else usd.TimeCode(time_code)
    prim.GetAttribute(name).Set(kind.FromNumpy(np.ascontiguousarray(values)), time)


def _write_camera(camera: Any, scene: Scene) -> None:
    """The path; OpenUSD's cameras look along −z with y up."""
    gf, path = _pxr("Gf"), scene.path
    height, width = path.cameras.size_px
    placed = camera.AddTransformOp()
    turn = torch.diag(torch.tensor([1.0, -1.0, -1.0, 1.0], dtype=torch.float64))
    aperture = {camera.GetHorizontalApertureAttr(): width, camera.GetVerticalApertureAttr(): height}
    for attribute, side_px in aperture.items():
        attribute.Set(_APERTURE_MM * side_px / width)
    for frame, time_s in enumerate(path.times_s.double().tolist()):
        code = time_s * TIME_CODES_PER_S
        pose = path.cameras.world_from_camera[frame].double() @ turn
        placed.Set(gf.Matrix4d(pose.T.tolist()), code)
        focal_px = float(path.cameras.focal_px[frame].double().mean())
        camera.GetFocalLengthAttr().Set(_APERTURE_MM * focal_px / width, code)


class UsdReader:
    """Reads states at any time, with OpenUSD's own interpolation."""

    def __init__(self, file: Path) -> None:
        self._stage = _pxr("Usd").Stage.Open(str(file))  # a prim does not keep its stage
        self._prim = self._stage.GetPrimAtPath(GAUSSIANS)
        if not self._prim or self._prim.GetTypeName() != SCHEMA:
            raise FileFormatError(f"{file}: expected {SCHEMA} at {GAUSSIANS}, got none")

    def state_at(self, time_s: float) -> Gaussians:
        """The Gaussians at ``time_s``, in our axes."""
        found = {name: self._value(name, time_s) for name in _NAMES}
        means = found["positions"]
        degree = int(self._prim.GetAttribute("radiance:sphericalHarmonicsDegree").Get())
        sh = found["radiance:sphericalHarmonicsCoefficients"].view(len(means), (degree + 1) ** 2, 3)
        return Gaussians(
            means=means,
            quats=found["orientations"].roll(1, 1),
            scales=found["scales"],
            opacities=found["opacities"],
            sh=sh,
        )

    def _value(self, name: str, time_s: float) -> torch.Tensor:
        values = self._prim.GetAttribute(name).Get(time_s * TIME_CODES_PER_S)
        return torch.from_numpy(np.array(values, np.float32, copy=True))


_NAMES = (
    *("positions", "orientations", "scales", "opacities"),
    "radiance:sphericalHarmonicsCoefficients",
)


def _pxr(name: str) -> ModuleType:
    try:
        from pxr import Gf, Usd, UsdGeom, UsdVol, Vt
    except ImportError as error:
        raise MissingExtraError(
            "OpenUSD: expected the package usd-core, got none; pip install 'diff4splat[usd]'"
        ) from error
    return {"Gf": Gf, "Usd": Usd, "UsdGeom": UsdGeom, "UsdVol": UsdVol, "Vt": Vt}[name]
