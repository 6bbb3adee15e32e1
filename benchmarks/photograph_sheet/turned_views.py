"""What lies out of the frame of a photograph, against the truth of its panorama.

Run ``python -m benchmarks.photograph_sheet.turned_views`` (needs viser's panoramas); prints
Markdown. A view of a panorama becomes a scene; the camera turns about its own centre to either
side, where the panorama knows what is there. Depth hardly matters, so this measures the fill alone.

    PSNR        of the pixels that the view does not show: a blur is best
    distance    perceptual distance of the turned views
    Fréchet     between the sets of generated and of true views, as ``eval`` names it
    detail      mean difference of neighbouring pixels out of the frame, over that of the truth
"""

import argparse
import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial

import torch
from jaxtyping import Bool, Float
from torch import Tensor

from benchmarks.photograph_sheet.__main__ import prepared
from benchmarks.photograph_sheet.sources import PHOTOGRAPHS, Photograph
from diff4splat.generation.inputs.input_image import InputImage
from diff4splat.generation.pipeline import Diff4SplatPipeline
from diff4splat.generation.settings import GenerationSettings
from diff4splat.geometry import quaternion
from diff4splat.geometry.camera import Camera
from diff4splat.geometry.rays import camera_rays
from diff4splat.metrics.distribution import frechet_distance
from diff4splat.metrics.features.fixed_features import FixedFeatures
from diff4splat.metrics.features.gradient_pyramid import GradientPyramidFeatures
from diff4splat.metrics.perceptual import perceptual_distance
from diff4splat.render.api import render
from diff4splat.scene.scene import Scene

MODEL = "small"
YAWS_DEG = tuple(range(0, 360, 45))
TURNS_DEG = (-20.0, -10.0, 10.0, 20.0)
Image = Float[Tensor, "h w 3"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Turned:
    """A view that is turned, and what of it the first one does not show."""

    found: Image
    truth: Image
    outside: Bool[Tensor, "h w"]

    @property
    def squared_error(self) -> float:
        """Mean over the pixels outside."""
        return float((self.found - self.truth)[self.outside].square().mean())

    def detail(self, image: Image) -> float:
        """Mean difference of neighbours in a row, outside."""
        both = self.outside[:, 1:] & self.outside[:, :-1]
        return float(image.diff(dim=1)[both].abs().mean())


def main() -> None:
    """One row of Markdown for each angle."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--without-inpainting", action="store_true", help="reflected borders")
    without = ("image_inpainting",) if parser.parse_args().without_inpainting else ()
    pipeline = Diff4SplatPipeline.from_pretrained(MODEL)
    generate = partial(pipeline, path="static", settings=GenerationSettings(without=without))
    panoramas = [each for each in PHOTOGRAPHS if each.yaw_deg is not None]
    views: dict[float, list[Turned]] = {turn: [] for turn in TURNS_DEG}
    for panorama in panoramas:
        for yaw in YAWS_DEG:
            for turn, view in turned_views(generate, panorama, float(yaw)).items():
                views[turn].append(view)
    print("| turned by | PSNR, outside [dB] | distance | Fréchet | detail |")
    print("|---|---:|---:|---:|---:|")
    for turn in (10.0, 20.0):
        print(row(f"{turn:.0f}°", views[turn] + views[-turn]))


def turned_views(
    generate: Callable[[InputImage], Scene], panorama: Photograph, yaw_deg: float
) -> dict[float, Turned]:
    """Of the view at ``yaw_deg``, by the angle to the right."""
    ahead = replace(panorama, yaw_deg=yaw_deg, pitch_deg=0.0)
    picture = prepared(ahead, MODEL)
    scene = generate(picture)
    views = {}
    for turn in TURNS_DEG:
        camera = turned(picture.camera, turn)
        views[turn] = Turned(
            found=render(scene, camera).rgb.clamp(0, 1),
            truth=prepared(replace(ahead, yaw_deg=yaw_deg + turn), MODEL).rgb,
            outside=~shown_by_first(picture.camera, turn),
        )
    return views


def turned(camera: Camera, right_deg: float) -> Camera:
    """``camera`` at the origin, turned about its vertical axis."""
    axis, angle = torch.tensor([[0.0, 1.0, 0.0]]), torch.tensor([math.radians(right_deg)])
    rotation = quaternion.to_matrix(quaternion.from_axis_angle(axis, angle))[0]
    pose = camera.world_from_camera.clone()
    pose[:3, :3] = pose[:3, :3] @ rotation.to(pose)
    return replace(camera, world_from_camera=pose)


def row(name: str, views: list[Turned]) -> str:
    """Means over ``views``; Fréchet between the sets."""
    features = FixedFeatures()
    psnr = [-10 * math.log10(max(view.squared_error, 1e-10)) for view in views]
    found, truth = torch.stack([v.found for v in views]), torch.stack([v.truth for v in views])
    distance = perceptual_distance(found, truth, GradientPyramidFeatures()).mean()
    sets = (features.embed_images(images.movedim(-1, 1)) for images in (found, truth))
    detail = sum(v.detail(v.found) for v in views) / sum(v.detail(v.truth) for v in views)
    return (
        f"| {name} | {sum(psnr) / len(psnr):.2f} | {float(distance):.4f} "
        f"| {frechet_distance(*sets):.3f} | {detail:.2f} |"
    )


def shown_by_first(camera: Camera, right_deg: float) -> Bool[Tensor, "h w"]:
    """Which pixels of the turned view the first one shows."""
    angle = math.radians(right_deg)
    x, y, z = camera_rays(camera).unbind(-1)
    ahead = z * math.cos(angle) - x * math.sin(angle)
    across = (x * math.cos(angle) + z * math.sin(angle)) / ahead
    (height, width), (fx, fy) = camera.size_px, camera.focal_px.unbind(-1)
    return (across.abs() * fx < width / 2) & ((y / ahead).abs() * fy < height / 2) & (ahead > 0)


if __name__ == "__main__":
    main()
