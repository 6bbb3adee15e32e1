"""The same clip seen otherwise: from its other cameras, mirrored, backwards, through a window.

Axes: ``f`` frames, ``h w`` pixels, ``n`` points. Everything stays exact: cameras, depth and tracks
follow the images. A mirrored world is the world under x → −x; poses are conjugated by that
mirror, so that cameras stay right-handed. Captions are not rewritten: "left" would be wrong in a
mirrored clip, so only stages without text may ask for it.
"""

from dataclasses import replace

import torch
from torch import Tensor

from diff4splat.data.clip import Clip, View
from diff4splat.data.view_labels import edited_labels
from diff4splat.errors import InputError
from diff4splat.geometry.camera import Camera
from diff4splat.training.batches.temporal_crop import drop_projections, from_first_camera
from diff4splat.training.recipe.data import DataSettings


def augmented(clip: Clip, settings: DataSettings, generator: torch.Generator) -> Clip:
    """What the settings ask for, drawn from ``generator``; the first camera is the identity.

    Raises:
        InputError: the window is larger than the images.
    """
    if settings.augment:
        first, mirror, backwards = torch.rand(3, generator=generator).tolist()
        clip = led_by(clip, int(first * len(clip.views)))
        clip = mirrored(clip) if mirror < 0.5 else clip
        clip = reversed_in_time(clip) if backwards < 0.5 else clip
    if min(settings.crop_px) > 0:
        clip = cropped(clip, settings.crop_px, generator)
    return clip


def led_by(clip: Clip, view: int) -> Clip:
    """Another view becomes the input view; the others follow in turn."""
    turned = clip.views[view:] + clip.views[:view]
    tracks = None if clip.tracks is None else drop_projections(clip.tracks)
    return from_first_camera(replace(clip, views=turned, tracks=tracks))


def mirrored(clip: Clip) -> Clip:
    """Left and right exchanged, in space and in images."""
    tracks = clip.tracks
    if tracks is not None:
        flip = tracks.positions.new_tensor([-1.0, 1.0, 1.0])
        tracks = replace(tracks, positions=tracks.positions * flip)
    return replace(clip, views=tuple(map(_mirrored_view, clip.views)), tracks=tracks)


def reversed_in_time(clip: Clip) -> Clip:
    """The last frame first; times run forwards again."""
    times_s, tracks = clip.times_s, clip.tracks
    if tracks is not None:
        known = None if tracks.known is None else tracks.known.flip(0)
        tracks = replace(drop_projections(tracks), positions=tracks.positions.flip(0), known=known)
    views = tuple(_backwards(view) for view in clip.views)
    times_s = times_s[0] + (times_s[-1] - times_s).flip(0)
    return from_first_camera(replace(clip, times_s=times_s, views=views, tracks=tracks))


def cropped(clip: Clip, size_px: tuple[int, int], generator: torch.Generator) -> Clip:
    """One random window of (height, width) for all frames and views.

    Raises:
        InputError: the images are smaller.
    """
    room = [whole - part for whole, part in zip(clip.size_px, size_px, strict=True)]
    if min(room) < 0:
        raise InputError(
            f"clip {clip.note.identifier}: expected images of at least "
            f"{size_px[0]}×{size_px[1]}, got {clip.size_px[0]}×{clip.size_px[1]}; lower crop_px"
        )
    top, left = (int(torch.randint(space + 1, (), generator=generator)) for space in room)
    return cut_out(clip, (top, left), size_px)


def cut_out(clip: Clip, corner: tuple[int, int], size_px: tuple[int, int]) -> Clip:
    """The window of (height, width) at (top, left) of all frames and views."""
    views = tuple(_window(view, corner, size_px) for view in clip.views)
    tracks = None if clip.tracks is None else drop_projections(clip.tracks)
    return replace(clip, views=views, tracks=tracks)


def _mirrored_view(view: View) -> View:
    uv = view.track_uv
    if uv is not None:
        uv = torch.stack([view.cameras.size_px[1] - uv[..., 0], uv[..., 1]], -1)
    return replace(
        view,
        **edited_labels(view, lambda label: label.flip(2)),
        rgb=view.rgb.flip(2),
        cameras=_mirrored_cameras(view.cameras),
        flow=None,
        track_uv=uv,
    )


def _mirrored_cameras(cameras: Camera) -> Camera:
    flip = torch.diag(cameras.world_from_camera.new_tensor([-1.0, 1.0, 1.0, 1.0]))
    center_px = cameras.center_px.clone()
    center_px[..., 0] = cameras.size_px[1] - center_px[..., 0]
    pose = flip @ cameras.world_from_camera @ flip
    return replace(cameras, center_px=center_px, world_from_camera=pose)


def _backwards(view: View) -> View:
    def turned(frames: Tensor | None) -> Tensor | None:
        return None if frames is None else frames.flip(0)

    order = torch.arange(len(view.cameras) - 1, -1, -1)
    return replace(
        view,
        **edited_labels(view, lambda label: label.flip(0)),
        rgb=view.rgb.flip(0),
        cameras=view.cameras[order],
        flow=None,
        track_uv=turned(view.track_uv),
        track_visible=turned(view.track_visible),
    )


def _window(view: View, corner: tuple[int, int], size_px: tuple[int, int]) -> View:
    (top, left), (height, width) = corner, size_px
    rows, columns = slice(top, top + height), slice(left, left + width)
    uv, visible = view.track_uv, view.track_visible
    if uv is not None:
        uv = uv - uv.new_tensor([left, top])
        inside = ((uv >= 0) & (uv < uv.new_tensor([width, height]))).all(-1)
        visible = None if visible is None else visible & inside
    return replace(
        view,
        **edited_labels(view, lambda label: label[:, rows, columns]),
        rgb=view.rgb[:, rows, columns],
        cameras=view.cameras.cropped(corner, size_px),
        flow=None,
        track_uv=uv,
        track_visible=visible,
    )
