"""What tells one fit from another."""

import hashlib
import json
from dataclasses import asdict, fields

from torch import Tensor

from diff4splat.data.capture.capture import Capture
from diff4splat.fitting.settings import FitSettings
from diff4splat.geometry.optics import Optics
from diff4splat.scene.scene import Scene


def fingerprint(capture: Capture, settings: FitSettings, init: Scene | None) -> str:
    """A hash of everything that decides the result, but not of when it was stopped."""
    numbers: list[Tensor] = [
        capture.cameras.world_from_camera,
        capture.cameras.focal_px,
        capture.times_s,
        capture.held_out,
    ]
    for track in capture.tracks.values():
        numbers += [track.times_s, track.world_from_camera]
    digest = hashlib.sha256(json.dumps(asdict(settings), sort_keys=True).encode())
    if capture.optics is not None:
        digest.update(_text(capture.optics).encode())
    if init is not None:
        numbers.append(init.gaussians.means)
    for tensor in numbers:
        digest.update(tensor.detach().contiguous().numpy().tobytes())
    return digest.hexdigest()


def _text(optics: Optics) -> str:
    """All numbers of optics and of its parts."""
    parts = [optics, optics.lens, optics.aperture, optics.shutter]
    found = [type(optics.lens).__name__]
    for part in parts:
        for one in () if part is None else fields(part):
            value = getattr(part, one.name)
            if isinstance(value, Tensor):
                value = value.detach().double().tolist()
            if part is not optics or isinstance(value, int | float | str):
                found.append(f"{one.name}={value}")
    return "; ".join(found)
