"""DynamicReplica: PyTorch3D cameras, half floats hidden in 16-bit PNG, torch files of tracks."""

import gzip
import json
from pathlib import Path

import numpy as np
import torch
from toy_scene import Eye, Truth

from dataset_writers.images import save

SIZE_PX, LENS, BASELINE_M = (36, 64), (45.0, 45.0, 32.0, 18.0), 0.1


def write(truth: Truth, root: Path) -> Path:
    split = root / "train"
    entries = []
    for name, eye in zip(("left", "right"), truth.eyes, strict=False):
        for t in range(truth.frames):
            entries.append(_write_frame(truth, eye, name, split, t))
    with gzip.open(split / "frame_annotations_train.jgz", "wt") as stream:
        json.dump(entries[::-1], stream)
    return root


def _write_frame(truth: Truth, eye: Eye, name: str, split: Path, t: int) -> dict:
    base = f"009850-3_obj_source_{name}"
    image = f"{base}/images/{base}-{t:04d}.png"
    depth = f"{base}/depths/{base}_{t:04d}.geometric.png"
    save(eye.rgb[t], split / image)
    metres = np.where(np.isfinite(eye.depth[t]), eye.depth[t], 0).astype(np.float16)
    bits = metres.view(np.uint16)
    bits[0, 0] = 0x8000
    save(bits, split / depth)
    flows = {}
    for key, flow, present in (
        ("flow_forward", eye.forward[min(t, truth.frames - 2)], t < truth.frames - 1),
        ("flow_backward", eye.backward[max(t - 1, 0)], t > 0),
    ):
        path = f"{base}/{key}/{base}_{t:04d}.png"
        flows[key] = {"path": path if present else None}
        if present:
            halves = np.concatenate([flow[..., 0], flow[..., 1]], 1).astype(np.float16)
            save(halves.view(np.uint16), split / path)
    trajectories = {"path": None}
    if name == "left":
        trajectories = {"path": f"{base}/trajectories/{t:06d}.pth"}
        file = split / trajectories["path"]
        file.parent.mkdir(parents=True, exist_ok=True)
        uv = np.concatenate([truth.uv[t], np.zeros((truth.uv.shape[1], 1))], 1)
        torch.save(
            {
                "traj_2d": torch.from_numpy(uv).float(),
                "traj_3d_world": torch.from_numpy(truth.positions[t]).float(),
                "verts_inds_vis": torch.from_numpy(truth.visible[t]),
                "instances": {},
                "img": torch.from_numpy(eye.rgb[t]),
            },
            file,
        )
    height, width = eye.depth.shape[1:]
    fx, fy, cx, cy = eye.lens
    unit = min(height, width) / 2
    axes = np.stack([-eye.poses[t, :3, 0], -eye.poses[t, :3, 1], eye.poses[t, :3, 2]], 1)
    return {
        "sequence_name": base,
        "frame_number": t,
        "frame_timestamp": t / 30,
        "camera_name": name,
        "image": {"path": image, "size": [height, width]},
        "depth": {"path": depth, "scale_adjustment": 1.0},
        "mask": None,
        "viewpoint": {
            "R": axes.tolist(),
            "T": (-eye.poses[t, :3, 3] @ axes).tolist(),
            "focal_length": [fx / unit, fy / unit],
            "principal_point": [(width / 2 - cx) / unit, (height / 2 - cy) / unit],
            "intrinsics_format": "ndc_isotropic",
        },
        **flows,
        "trajectories": trajectories,
    }
