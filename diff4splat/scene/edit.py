"""Edits that return a new scene: move, crop, merge, prune, leave still Gaussians out.

Axes: ``n`` Gaussians, ``m`` moving Gaussians, ``t`` key times. A similarity carries a point x to
scale · R x + translation. Under it

    mean' = scale · R mean + translation     quat' = R ⊗ quat     scale' = scale · scale
    offset' = scale · R offset               rotation' = rotation (it stands right of quat)
    velocity' = scale · R velocity           colour waves turn like sh; times stay
    sh' = the same lobes turned by R         camera pose' = (R · rotation, similarity of the centre)

so that editing commutes with ``state_at``.
"""

import math
from dataclasses import dataclass, replace

import torch
from jaxtyping import Bool, Float
from torch import Tensor

from diff4splat.errors import ConfigError, InputError
from diff4splat.geometry import quaternion, rigid
from diff4splat.paths.camera_path import CameraPath
from diff4splat.scene import harmonics
from diff4splat.scene.gaussians import Gaussians, concatenate
from diff4splat.scene.motion import keyframe_algebra, spacetime_algebra
from diff4splat.scene.motion.keyframes import KeyframeMotion
from diff4splat.scene.motion.protocol import Motion
from diff4splat.scene.motion.spacetime import SpacetimeMotion
from diff4splat.scene.scene import Provenance, Scene

MIN_OPACITY = 0.005
"""τ_opacity of Diff4Splat (arXiv 2511.00503), in training and inference."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Similarity:
    """Rotation, uniform scale and translation, in world space."""

    rotation: Float[Tensor, "4"]
    """Quaternion (w, x, y, z); normalised when used."""
    translation: Float[Tensor, "3"]
    scale: float = 1.0

    def __post_init__(self) -> None:
        if not (math.isfinite(self.scale) and self.scale > 0):
            raise InputError(
                f"Similarity.scale: expected a finite number above 0, got {self.scale}"
            )
        if not bool(torch.isfinite(torch.cat([self.rotation, self.translation])).all()):
            raise InputError("Similarity: expected a finite rotation and translation")

    def inverse(self) -> "Similarity":
        """The similarity that undoes this one."""
        back = quaternion.conjugate(quaternion.normalize(self.rotation))
        moved = -quaternion.rotate(back, self.translation) / self.scale
        return Similarity(rotation=back, translation=moved, scale=1 / self.scale)

    def points(self, points: Float[Tensor, "*b 3"]) -> Float[Tensor, "*b 3"]:
        """Carry points."""
        return self.directions(points) * self.scale + self.translation.to(points)

    def directions(self, vectors: Float[Tensor, "*b 3"]) -> Float[Tensor, "*b 3"]:
        """Turn vectors; neither moved nor scaled."""
        return vectors @ quaternion.to_matrix(self.rotation.to(vectors)).mT


@dataclass(frozen=True, slots=True, kw_only=True)
class Box:
    """An axis-aligned box in world space; infinite sides are open."""

    low: tuple[float, float, float]
    high: tuple[float, float, float]

    def __post_init__(self) -> None:
        if not all(low <= high for low, high in zip(self.low, self.high, strict=True)):
            raise InputError(f"Box: expected low <= high on each axis, got {self.low}, {self.high}")

    def contains(self, points: Float[Tensor, "n 3"]) -> Bool[Tensor, " n"]:
        """Which points lie inside or on the border."""
        low, high = points.new_tensor(self.low), points.new_tensor(self.high)
        return ((points >= low) & (points <= high)).all(-1)


def transform(scene: Scene, similarity: Similarity) -> Scene:
    """The scene, its motion and its suggested cameras in another world frame."""
    return replace(
        scene,
        gaussians=transform_gaussians(scene.gaussians, similarity),
        motion=_transform_motion(scene.motion, similarity),
        path=_transform_path(scene.path, similarity),
    )


def transform_gaussians(gaussians: Gaussians, similarity: Similarity) -> Gaussians:
    """Gaussians in another world frame, view-dependent colour included."""
    rotation = quaternion.normalize(similarity.rotation.to(gaussians.quats))
    matrix = quaternion.to_matrix(similarity.rotation.double())
    unturned_if_zero = quaternion.normalize(gaussians.quats)
    return replace(
        gaussians,
        means=similarity.points(gaussians.means),
        quats=quaternion.multiply(rotation.expand_as(gaussians.quats), unturned_if_zero),
        scales=gaussians.scales * similarity.scale,
        sh=harmonics.rotate(gaussians.sh, matrix),
    )


def crop(scene: Scene, box: Box) -> Scene:
    """Keep the Gaussians whose canonical mean lies in ``box``, wherever they move later."""
    return scene.select(box.contains(scene.gaussians.means))


def prune(scene: Scene, min_opacity: float = MIN_OPACITY) -> Scene:
    """Drop Gaussians with an opacity below ``min_opacity``; the others keep their order."""
    if not 0 <= min_opacity <= 1:
        raise ConfigError(f"min_opacity: expected a number in [0, 1], got {min_opacity}")
    return scene.select(scene.gaussians.opacities >= min_opacity)


def simplify_motion(
    scene: Scene,
    *,
    offset: float = 0.0,
    angle_rad: float = 0.0,
    log_scale: float = 0.0,
    opacity: float = 0.0,
) -> Scene:
    """Make Gaussians static that never leave their canonical state by more than a tolerance.

    ``offset`` is in scene units. The state at every key, or at any time of a native 4D motion,
    changes by no more than the tolerances; with all of them 0 nothing changes. When nothing moves,
    the motion becomes ``StaticMotion``.
    """
    motion = scene.motion
    if isinstance(motion, SpacetimeMotion):
        change = spacetime_algebra.largest_change(motion, scene.gaussians)
        moves = ~change.within(offset, opacity)
        return replace(scene, motion=spacetime_algebra.keep_moving(motion, moves))
    if not isinstance(motion, KeyframeMotion):
        return scene
    still = keyframe_algebra.largest_change(motion).within(offset, angle_rad, log_scale)
    return replace(scene, motion=keyframe_algebra.keep_moving(motion, ~still))


def merge(first: Scene, second: Scene) -> Scene:
    """Both scenes in one, ``first``'s Gaussians first; suggested path and dilation are ``first``'s.

    ``second`` is cast to the precision and device of ``first``. Key frames at different times are
    resampled to all of them, which changes nothing between keys because linear motion stays linear.

    Raises:
        ConfigError: motions without an exact common form: of different kinds, cubic key frames at
            different times, or native 4D ones of different ranges, gates or periods.
    """
    means = first.gaussians.means
    second = second.to(means.device).to(means.dtype)
    degree = max(first.gaussians.degree, second.gaussians.degree)
    parts = [_pad_harmonics(scene.gaussians, degree) for scene in (first, second)]
    return Scene(
        gaussians=concatenate(parts),
        motion=_join_motions(first.motion, second.motion, len(first.gaussians), degree),
        path=first.path,
        provenance=_merge_provenance(first.provenance, second.provenance),
        dilation_px2=first.dilation_px2,
    )


def _transform_motion(motion: Motion, similarity: Similarity) -> Motion:
    if isinstance(motion, KeyframeMotion):
        offsets = similarity.directions(motion.offsets) * similarity.scale
        return replace(motion, offsets=offsets)
    if isinstance(motion, SpacetimeMotion):
        matrix = quaternion.to_matrix(similarity.rotation.double())
        return spacetime_algebra.turn(motion, matrix, similarity.scale)
    keyframe_algebra.require_editable(motion, "transform")
    return motion


def _join_motions(first: Motion, second: Motion, count: int, degree: int) -> Motion:
    if isinstance(first, SpacetimeMotion) or isinstance(second, SpacetimeMotion):
        return spacetime_algebra.join(first, second, count, degree)
    return keyframe_algebra.join(first, second, count)


def _transform_path(path: CameraPath, similarity: Similarity) -> CameraPath:
    pose = path.cameras.world_from_camera
    rotation = quaternion.to_matrix(similarity.rotation.to(pose)) @ pose[..., :3, :3]
    moved = rigid.from_parts(rotation, similarity.points(pose[..., :3, 3]))
    return replace(path, cameras=path.cameras.with_pose(moved))


def _pad_harmonics(gaussians: Gaussians, degree: int) -> Gaussians:
    missing = harmonics.BAND_SIZES[degree] - gaussians.sh.shape[1]
    padding = gaussians.sh.new_zeros(len(gaussians), missing, 3)
    return replace(gaussians, sh=torch.cat([gaussians.sh, padding], 1))


def _merge_provenance(first: Provenance, second: Provenance) -> Provenance:
    """What both share stays; what differs is listed, so that no licence gets lost."""

    def both(name: str) -> str:
        values = dict.fromkeys([getattr(first, name), getattr(second, name)])
        return "; ".join(values)

    return Provenance(
        generator=both("generator"),
        model=both("model"),
        weights_sha256=both("weights_sha256"),
        seed=first.seed if first.seed == second.seed else None,
        prompt=first.prompt if first.prompt == second.prompt else None,
        license=both("license"),
        untrained=first.untrained or second.untrained,
    )
