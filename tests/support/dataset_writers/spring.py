"""Spring: ground truth on twice the grid in HDF5, values in pixels of the images."""

from pathlib import Path

import h5py
import numpy as np
from toy_scene import Truth

from dataset_writers.images import save

SIZE_PX, LENS, BASELINE_M = (27, 48), (50.0, 50.0, 24.0, 13.5), 0.065
ODD = 7.5
"""Stands where samples between the images' pixels are: whoever takes them is wrong."""


def write(truth: Truth, root: Path) -> Path:
    folder = root / "spring" / "train" / "0001"
    for name, eye in zip(("left", "right"), truth.eyes, strict=False):
        for t in range(truth.frames):
            number = f"{t + 1:04d}"
            save(eye.rgb[t], folder / f"frame_{name}" / f"frame_{name}_{number}.png")
            sky = eye.which[t] < 0
            disparity = np.where(sky, np.nan, eye.lens[0] * BASELINE_M / eye.depth[t])
            _hdf5(folder, f"disp1_{name}", number, "dsp5", ("disparity", disparity))
            far = np.repeat(np.repeat(sky, 2, 0), 2, 1)
            save(
                (far * 255).astype(np.uint8),
                folder / "maps" / f"skymap_{name}" / f"skymap_{name}_{number}.png",
            )
            if t < truth.frames - 1:
                _hdf5(folder, f"flow_FW_{name}", number, "flo5", ("flow", eye.forward[t]))
            if t:
                _hdf5(folder, f"flow_BW_{name}", number, "flo5", ("flow", eye.backward[t - 1]))
    cameras = folder / "cam_data"
    cameras.mkdir()
    left = truth.left
    np.savetxt(cameras / "intrinsics.txt", np.tile(left.lens, (truth.frames, 1)), "%.17g")
    np.savetxt(cameras / "extrinsics.txt", np.linalg.inv(left.poses).reshape(-1, 16), "%.17g")
    return root


def _hdf5(folder: Path, kind: str, number: str, suffix: str, named: tuple[str, np.ndarray]) -> None:
    key, values = named
    fine = np.full((2 * values.shape[0], 2 * values.shape[1], *values.shape[2:]), ODD, np.float32)
    fine[::2, ::2] = values
    file = folder / kind / f"{kind}_{number}.{suffix}"
    file.parent.mkdir(parents=True, exist_ok=True)
    with h5py.File(file, "w") as opened:
        opened.create_dataset(key, data=fine, compression="gzip")
