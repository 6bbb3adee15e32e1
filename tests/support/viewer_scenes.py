"""Small scenes for the viewer's page: one for each thing that it has to draw."""

import torch

from diff4splat.geometry.camera import pinhole
from diff4splat.paths.camera_path import CameraPath
from diff4splat.scene.gaussians import Gaussians
from diff4splat.scene.motion.keyframes import KeyframeMotion
from diff4splat.scene.motion.static import StaticMotion
from diff4splat.scene.scene import Provenance, Scene

SIZE_PX, FRAMES, SPAN_S = (120, 160), 9, 2.0


def cloud(count: int, degree: int = 0, opacity: tuple[float, float] = (0.6, 1.0)) -> Gaussians:
    """Turned ellipsoids in front of the camera."""
    generator = torch.Generator().manual_seed(count + degree)

    def uniform(*shape: int) -> torch.Tensor:
        return torch.rand(shape, generator=generator)

    depth = 2 + 6 * uniform(count)
    place = 2 * uniform(count, 2) - 1
    sh = 0.3 * torch.randn(count, (degree + 1) ** 2, 3, generator=generator)
    sh[:, 0] = (uniform(count, 3) - 0.5) / 0.28209479177387814
    low, high = opacity
    return Gaussians(
        means=torch.cat([place * depth[:, None] * torch.tensor([0.6, 0.45]), depth[:, None]], 1),
        quats=torch.randn(count, 4, generator=generator),
        scales=torch.exp(-3.5 + uniform(count, 3)),
        opacities=low + (high - low) * uniform(count),
        sh=sh,
    )


def path() -> CameraPath:
    """A camera that slides and turns a little."""
    poses = torch.eye(4).repeat(FRAMES, 1, 1)
    angle = torch.linspace(0, 0.2, FRAMES)
    poses[:, 0, 0] = poses[:, 2, 2] = angle.cos()
    poses[:, 0, 2], poses[:, 2, 0] = angle.sin(), -angle.sin()
    poses[:, 0, 3] = torch.linspace(0, -0.8, FRAMES)
    camera = pinhole(130.0, SIZE_PX)
    return CameraPath(cameras=camera.with_pose(poses), times_s=torch.linspace(0, SPAN_S, FRAMES))


def key_motion(
    count: int, interpolation: str = "linear", turning: bool = False, keys: int = 5
) -> KeyframeMotion:
    """Every third of ``count`` Gaussians moves; with ``turning`` it turns and grows too."""
    generator = torch.Generator().manual_seed(7)
    index = torch.arange(0, count, 3)
    shape = (keys, len(index))
    rotations = torch.zeros(*shape, 4)
    rotations[..., 0] = 1
    sizes = torch.zeros(*shape, 3)
    if turning:
        rotations = torch.randn(*shape, 4, generator=generator)
        sizes = 0.5 * torch.randn(*shape, 3, generator=generator)
    return KeyframeMotion(
        key_times_s=torch.tensor([0.0, 0.3, 0.9, 1.4, SPAN_S])[:keys],
        moving_index=index,
        offsets=0.3 * torch.randn(*shape, 3, generator=generator),
        rotations=rotations,
        log_scale_offsets=sizes,
        interpolation=interpolation,
    )


def scene(
    gaussians: Gaussians, motion: object = None, dilation_px2: float = 0.3, prompt: str = "a test"
) -> Scene:
    """A scene of them on the path."""
    return Scene(
        gaussians=gaussians,
        motion=motion or StaticMotion(time_range_s=(0.0, SPAN_S)),
        path=path(),
        provenance=Provenance(generator="test", model="none", prompt=prompt, license="CC0-1.0"),
        dilation_px2=dilation_px2,
    )


def drawn_scenes() -> dict[str, Scene]:
    """By what is special about them."""
    return {
        "still": scene(cloud(1500), dilation_px2=0.0),
        "key_frames": scene(cloud(1500), key_motion(1500)),
        "cubic": scene(cloud(900), key_motion(900, "cubic")),
        "turning": scene(cloud(1200), key_motion(1200, turning=True)),
        "faint": scene(cloud(6000, opacity=(0.02, 0.5))),
        "harmonics": scene(cloud(1000, degree=3)),
    }
