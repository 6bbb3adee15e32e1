"""Memory of a fit against the number of frames, at equal Gaussians: it must not grow with them.

    python -m benchmarks.fitting.memory

Every fit runs in a process of its own, with images that are drawn when they are read and 32 MB of
them kept. What is compared is the peak of the process over that of one that only imports.
"""

import json
import math
import subprocess
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path

CAMERAS = 10
TIMES = (3, 30)
"""30 and 300 frames."""
SIDE_PX = 200


def main() -> None:
    rows = [measure(motion, times) for motion in ("hexplane", "spacetime") for times in (1, *TIMES)]
    print("| motion | frames | Gaussians | peak, MB | scene file, MB |\n|---|---|---|---|---|")
    for row in rows:
        print(
            "| {motion} | {frames} | {gaussians:,} | {peak_mb:.0f} | {file_mb:.2f} |".format(**row)
        )


def measure(motion: str, times: int) -> dict[str, float | str]:
    """One fit in its own process."""
    command = [sys.executable, "-m", "benchmarks.fitting.memory", motion, str(times)]
    done = subprocess.run(command, check=True, capture_output=True, text=True)
    return json.loads(done.stdout.splitlines()[-1])


@dataclass(kw_only=True)
class Drawn:
    """Stripes that move; made when asked for."""

    times: int

    def __len__(self) -> int:
        return CAMERAS * self.times

    def read(self, index: int):
        import torch

        from diff4splat.data.capture.capture import Frame

        phase = 2 * math.pi * (index % self.times) / max(self.times, 2)
        row = 0.5 + 0.5 * torch.sin(torch.arange(SIDE_PX) / 9 + phase)
        return Frame(rgb=row[:, None, None].expand(SIDE_PX, SIDE_PX, 3).contiguous())


def fit_once(motion: str, times: int) -> dict[str, float | str]:
    """Fit a few steps and say what it took."""
    import torch

    from diff4splat.data.capture.capture import Capture, PointCloud
    from diff4splat.fitting.fit import fit_scene
    from diff4splat.fitting.fit_types import FitRequest
    from diff4splat.fitting.settings import DensitySettings, FitSettings, StaticDetectionSettings
    from diff4splat.geometry import rigid
    from diff4splat.geometry.camera import pinhole, stack_cameras
    from diff4splat.progress.phases import peak_memory_bytes

    lens = pinhole(1.1 * SIDE_PX, (SIDE_PX, SIDE_PX), torch.float64)
    poses = []
    for number in range(CAMERAS):
        angle = math.radians(-40 + 80 * number / (CAMERAS - 1))
        eye = torch.tensor([3 * math.sin(angle), 0.0, -3 * math.cos(angle)]).double()
        poses.append(
            rigid.look_at(eye, torch.zeros(3).double(), torch.tensor([0.0, 1, 0]).double())
        )
    index = torch.arange(CAMERAS).repeat_interleave(times)
    generator = torch.Generator().manual_seed(0)
    capture = Capture(
        name="stripes", source="drawn",
        cameras=stack_cameras([lens.with_pose(poses[i]) for i in index.tolist()]),
        times_s=torch.arange(times).double().repeat(CAMERAS) / 30, camera_index=index,
        held_out=torch.zeros(len(index), dtype=torch.bool), frames=Drawn(times=times),
        points=PointCloud(positions=torch.rand(20_000, 3, generator=generator) - 0.5,
                          rgb=torch.full((20_000, 3), 0.5)),
        background=(0.0, 0.0, 0.0),
    )  # fmt: skip
    settings = FitSettings(
        motion=motion, coarse_steps=20, fine_steps=20, picture_memory_mb=32,
        density=DensitySettings(budget=20_000, until=0.0),
        stillness=StaticDetectionSettings(min_score=0.0),
    )  # fmt: skip
    with tempfile.TemporaryDirectory() as folder:
        result = fit_scene(FitRequest(capture=capture, settings=settings, folder=Path(folder)))
        peak = peak_memory_bytes()
        return {
            "motion": motion, "frames": len(capture), "gaussians": len(result.gaussians),
            "peak_mb": peak / 1e6, "file_mb": scene_bytes(result, capture, Path(folder)) / 1e6,
        }  # fmt: skip


def scene_bytes(result, capture, folder: Path) -> int:
    """Of the scene file, without the camera path."""
    from diff4splat.io.scene_files.scene_file import save_scene
    from diff4splat.paths.camera_path import CameraPath
    from diff4splat.scene.scene import Provenance, Scene

    path = CameraPath(cameras=capture.cameras[:1], times_s=capture.times_s[:1])
    scene = Scene(
        gaussians=result.gaussians, motion=result.motion, path=path,
        provenance=Provenance(generator="benchmark"),
    )  # fmt: skip
    save_scene(scene, folder / "scene.safetensors")
    return (folder / "scene.safetensors").stat().st_size


if __name__ == "__main__":
    if len(sys.argv) == 3:
        print(json.dumps(fit_once(sys.argv[1], int(sys.argv[2]))))
    else:
        main()
