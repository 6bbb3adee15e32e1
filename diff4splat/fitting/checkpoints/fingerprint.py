"""A fingerprint that identifies a fit, so that a checkpoint is only resumed by the same fit."""

import hashlib
import json
from dataclasses import asdict, fields

from torch import Tensor

from diff4splat.data.capture.capture import Capture
from diff4splat.fitting.settings import FitSettings
from diff4splat.geometry.optics import Optics
from diff4splat.scene.scene import Scene


def fingerprint(capture: Capture, settings: FitSettings, init: Scene | None) -> str:
    """SHA-256 over all inputs that decide the result; excludes time limits."""
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
        digest.update(_optics_text(capture.optics).encode())
    if init is not None:
        numbers.append(init.gaussians.means)
    for tensor in numbers:
        digest.update(tensor.detach().contiguous().numpy().tobytes())
    return digest.hexdigest()


def _optics_text(optics: Optics) -> str:
    """All numbers of the optics and of its components."""
    components = [optics, optics.lens, optics.aperture, optics.shutter]
    text = [type(optics.lens).__name__]
    for component in components:
        for entry in () if component is None else fields(component):
            value = getattr(component, entry.name)
            if isinstance(value, Tensor):
                value = value.detach().double().tolist()
            if component is not optics or isinstance(value, int | float | str):
                text.append(f"{entry.name}={value}")
    return "; ".join(text)
