"""What frames of a video cost beside images made one by one.

Run ``python benchmarks/videos.py``. The scene is a cloud of 100,000 Gaussians at 512² of which a
share moves by nine cubic key frames: those nearest to the middle of the image. The camera stands
or slides sideways. Videos and single images alternate, and the best of the rounds counts.
"""

import os
import time
from collections.abc import Callable

os.environ.setdefault("OMP_WAIT_POLICY", "PASSIVE")

import torch

from diff4splat.geometry.camera import Camera, pinhole
from diff4splat.paths.camera_path import CameraPath
from diff4splat.render.api import render, render_video
from diff4splat.scene.gaussians import Gaussians
from diff4splat.scene.motion.keyframes import KeyframeMotion
from diff4splat.scene.scene import Provenance, Scene

COUNT, SIZE_PX, FRAMES, ROUNDS, KEYS = 100_000, (512, 512), 16, 5, 9
SHARES = (0.0, 0.1, 0.5, 1.0)


def cloud(camera: Camera, generator: torch.Generator) -> Gaussians:
    """3-sigma radius 3 to 6 px with the dilation, opacity 0.1 to 0.9, plain colour."""
    uniform = torch.rand(COUNT, 10, generator=generator)
    depth = 1 + 4 * uniform[:, :1]
    sigma_px = ((1 + uniform[:, 1:2]).square() - 0.3).sqrt()
    return Gaussians(
        means=torch.cat([(uniform[:, 2:4] - 0.5) * depth, depth], 1),
        quats=torch.randn(COUNT, 4, generator=generator),
        scales=sigma_px * depth / camera.focal_px[0] * (0.8 + 0.4 * uniform[:, 4:7]),
        opacities=0.1 + 0.8 * uniform[:, 7],
        sh=torch.rand(COUNT, 1, 3, generator=generator),
    )


def keyed(gaussians: Gaussians, share: float, generator: torch.Generator) -> KeyframeMotion:
    count = int(share * COUNT)
    off_axis = (gaussians.means[:, :2] / gaussians.means[:, 2:]).norm(dim=1)

    def noise(width: int) -> torch.Tensor:
        return torch.randn(KEYS, count, width, generator=generator)

    return KeyframeMotion(
        key_times_s=torch.linspace(0, 1, KEYS),
        moving_index=off_axis.argsort()[:count].sort().values,
        offsets=0.02 * noise(3).cumsum(0),
        rotations=torch.tensor([1.0, 0.0, 0.0, 0.0]) + 0.2 * noise(4),
        log_scale_offsets=0.1 * noise(3),
        interpolation="cubic",
    )


def moving_scene(share: float, sliding: bool) -> Scene:
    generator = torch.Generator().manual_seed(0)
    camera = pinhole(float(SIZE_PX[1]), SIZE_PX)
    gaussians = cloud(camera, generator)
    poses = torch.eye(4).repeat(FRAMES, 1, 1)
    if sliding:
        poses[:, 0, 3] = torch.linspace(-0.2, 0.2, FRAMES)
    path = CameraPath(cameras=camera.with_pose(poses), times_s=torch.linspace(0, 1, FRAMES))
    return Scene(
        gaussians=gaussians,
        motion=keyed(gaussians, share, generator),
        path=path,
        provenance=Provenance(generator="benchmark"),
    )


def best_ms(work: Callable[[], object], best: float) -> float:
    began = time.perf_counter()
    work()
    return min(best, 1000 * (time.perf_counter() - began) / FRAMES)


@torch.no_grad()
def measure(scene: Scene) -> tuple[float, float]:
    """Milliseconds per frame of a video, and of images one by one."""
    times_s = scene.path.times_s.tolist()

    def together() -> None:
        for _ in render_video(scene, scene.path):
            pass

    def one_by_one() -> None:
        for index, time_s in enumerate(times_s):
            render(scene, scene.path.cameras[index], time_s)

    video = single = float("inf")
    for _ in range(ROUNDS):
        video, single = best_ms(together, video), best_ms(one_by_one, single)
    return video, single


if __name__ == "__main__":
    print(f"{COUNT} Gaussians, {FRAMES} frames, {torch.get_num_threads()} threads")
    print("| camera | moving | ms per frame of a video | ms per single picture | ratio |")
    print("|---|---|---|---|---|")
    for sliding in (False, True):
        for share in SHARES:
            video, single = measure(moving_scene(share, sliding))
            camera = "slides" if sliding else "stands"
            print(
                f"| {camera} | {share:.0%} | {video:.1f} | {single:.1f} | {single / video:.2f} |",
                flush=True,
            )
