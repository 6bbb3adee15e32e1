"""Optics and the way of a camera as plain JSON values, and back without losing a bit.

Lengths are scene units, times seconds; see ``lens_json`` for lenses.
"""

import torch

from diff4splat.geometry.optics import Aperture, Optics, Shutter
from diff4splat.geometry.pose_track import PoseTrack
from diff4splat.io.cameras.lens_json import as_file_error, exact_list, lens_json, read_lens
from diff4splat.io.strict_json import (
    JsonObject,
    as_object,
    exact,
    take_list,
    take_number,
    take_numbers,
    take_object,
    take_pose,
    take_text,
)

SURFACES = ("plane", "sphere")
DIRECTIONS = ("top-to-bottom", "bottom-to-top", "left-to-right", "right-to-left")
TIMESTAMPS = ("middle", "start")


def optics_json(optics: Optics) -> dict[str, object]:
    """``optics`` as JSON values.

    Raises:
        InputError: a lens of a kind that files cannot hold.
    """
    aperture, shutter = optics.aperture, optics.shutter
    return {
        "lens": lens_json(optics.lens),
        "aperture": None
        if aperture is None
        else {
            "radius": exact(aperture.radius),
            "focus_distance": exact(aperture.focus_distance),
            "surface": aperture.surface,
        },
        "shutter": None
        if shutter is None
        else {"readout_s": exact(shutter.readout_s), "direction": shutter.direction},
        "exposure_s": exact(optics.exposure_s),
        "timestamp": optics.timestamp,
    }


def read_optics(document: object, where: str) -> Optics:
    """The optics that ``optics_json`` wrote.

    Raises:
        FileFormatError: a value is missing, of another kind, or impossible; names it.
    """
    own = as_object(document, where)
    aperture, shutter = (_optional(own, key, where) for key in ("aperture", "shutter"))
    with as_file_error(where):
        return Optics(
            lens=read_lens(take_object(own, "lens", where), f"{where}: 'lens'"),
            aperture=None if aperture is None else _aperture(aperture, f"{where}: 'aperture'"),
            shutter=None if shutter is None else _shutter(shutter, f"{where}: 'shutter'"),
            exposure_s=take_number(own, "exposure_s", where),
            timestamp=take_text(own, "timestamp", where, TIMESTAMPS),
        )


def track_json(track: PoseTrack) -> dict[str, object]:
    """The way of a camera as JSON values."""
    return {
        "interpolation": "positions in a line, rotations by slerp; stands before and after",
        "times_s": exact_list(track.times_s),
        "world_from_camera": track.world_from_camera.detach().double().tolist(),
    }


def read_track(document: object, where: str) -> PoseTrack:
    """The way that ``track_json`` wrote, float64.

    Raises:
        FileFormatError: poses that are none, times that do not increase, or other numbers of both.
    """
    own = as_object(document, where)
    poses = take_list(own, "world_from_camera", where)
    with as_file_error(where):
        return PoseTrack(
            times_s=take_numbers(own, "times_s", len(poses), where),
            world_from_camera=torch.stack(
                [
                    take_pose({"world_from_camera": pose}, "world_from_camera", f"{where}: {i}")
                    for i, pose in enumerate(poses)
                ]
            ),
        )


def _aperture(own: JsonObject, where: str) -> Aperture:
    return Aperture(
        radius=take_number(own, "radius", where),
        focus_distance=take_number(own, "focus_distance", where),
        surface=take_text(own, "surface", where, SURFACES),
    )


def _shutter(own: JsonObject, where: str) -> Shutter:
    return Shutter(
        readout_s=take_number(own, "readout_s", where),
        direction=take_text(own, "direction", where, DIRECTIONS),
    )


def _optional(own: JsonObject, key: str, where: str) -> dict[str, object] | None:
    return None if own.get(key) is None else take_object(own, key, where)
