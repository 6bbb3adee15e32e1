"""Graphs of LDRM and the deformation network.

With refinement, optical flow has a graph of its own: one call per distance in time, each
initialised with the result of the one before.
"""

from torch import Tensor, nn

from diff4splat.geometry.camera import Camera
from diff4splat.models.blocks.conv_block import CELL_PX
from diff4splat.models.config.model import ModelConfig
from diff4splat.models.config.networks import (
    DEFORMATION_SPLIT,
    GAUSSIAN_SPLIT,
    TIME_STRIDE,
    TOKEN_PATCH,
)
from diff4splat.models.ldrm.optical_flow.optical_flow import optical_flow
from diff4splat.models.ldrm.refinement.decoder import widths
from diff4splat.models.ldrm.refinement.motion_features import MOTION_CHANNELS
from diff4splat.models.ldrm.refinement.posed_video import PosedVideo, StartDistance
from diff4splat.models.onnx.manifest import TensorSpec
from diff4splat.models.onnx.shapes import Axis
from diff4splat.models.onnx_export.source import (
    GraphSource,
    InputSource,
    TensorFunction,
    normal,
    output,
    pixels,
    poses,
    unit,
)

FRAMES: Axis = f"{TIME_STRIDE}*packs+1"
KEYS: Axis = "packs+1"


def ldrm_graphs(network: nn.Module, config: ModelConfig) -> list[GraphSource]:
    """Raw maps, and with refinement the optical flow of pairs of images."""
    refined = config.refinement.used
    posed = refined or config.ldrm.input == "frames"
    size = _pixels(config)
    cells = (f"{TOKEN_PATCH}*rows", f"{TOKEN_PATCH}*columns")

    def maps(ldrm: nn.Module, latent: Tensor, camera: Tensor, *video: Tensor) -> tuple[Tensor, ...]:
        found = ldrm(latent, camera, posed_video(*video) if video else None, moving=False)
        states = (found.gaussians, found.tokens, found.border)
        return tuple(tensor for tensor in states if tensor is not None)

    graph = GraphSource(
        name="ldrm",
        part="ldrm",
        module=TensorFunction(network, maps),
        inputs=(
            normal("latent", "batch", config.vae.latent_channels, KEYS, *cells),
            normal("camera", "batch", 6, FRAMES, *size),
            *(posed_sources(config) if posed else ()),
            *(start_sources(config) if config.refinement.depth_prior else ()),
        ),
        outputs=_map_outputs(config),
    )
    return [graph, _optical_flow(config)] if refined else [graph]


def deformation_graphs(network: nn.Module, config: ModelConfig) -> list[GraphSource]:
    """Raw deformation of every Gaussian at one time."""
    channels = sum(DEFORMATION_SPLIT)
    if config.refinement.used:
        keys, stride = "frames", config.token_px // CELL_PX
        tokens = (widths(config.refinement.channels)[0] + MOTION_CHANNELS, keys)
        raw = output("raw", "batch", channels, keys, *_pixels(config))
        cells = (f"{stride}*rows", f"{stride}*columns")
    else:
        tokens, cells = (config.ldrm.width, KEYS), ("rows", "columns")
        raw = output("raw", "batch", channels, FRAMES, *_grid(config))
    return [
        GraphSource(
            name="deformation",
            part="deformation",
            module=TensorFunction(network, lambda deform, *inputs: (deform(*inputs),)),
            inputs=(normal("tokens", "batch", *tokens, *cells), unit("time", "batch")),
            outputs=(raw,),
        )
    ]


def posed_video(
    rgb: Tensor, focal_px: Tensor, center_px: Tensor, pose: Tensor, *start: Tensor
) -> PosedVideo:
    """A video from the tensors of ``posed_sources``, and of ``start_sources`` if there are any."""
    cameras = Camera(
        focal_px=focal_px,
        center_px=center_px,
        world_from_camera=pose,
        size_px=tuple(rgb.shape[3:]),
    )
    if not start:
        return PosedVideo(rgb=rgb, cameras=cameras)
    prior, parallax, confidence = start
    distances = StartDistance(prior=prior, parallax=parallax, confidence=confidence)
    return PosedVideo(rgb=rgb, cameras=cameras, start=distances)


def posed_sources(config: ModelConfig) -> tuple[InputSource, ...]:
    """Frames in [0, 1] and their cameras."""
    return (
        unit("rgb", "batch", 3, FRAMES, *_pixels(config)),
        pixels("focal_px", "batch", FRAMES, 2),
        pixels("center_px", "batch", FRAMES, 2),
        poses("world_from_camera", "batch", FRAMES, 4, 4),
    )


def start_sources(config: ModelConfig) -> tuple[InputSource, ...]:
    """Where key frames start: distances by prior and parallax, and the confidence of parallax."""
    shape = ("batch", KEYS, *_pixels(config))
    return normal("prior", *shape), normal("parallax", *shape), unit("confidence", *shape)


def _map_outputs(config: ModelConfig) -> tuple[TensorSpec, ...]:
    channels = sum(GAUSSIAN_SPLIT)
    if not config.refinement.used:
        return (
            output("gaussians", "batch", channels, FRAMES, *_grid(config)),
            output("tokens", "batch", config.ldrm.width, KEYS, "rows", "columns"),
        )
    side, margin = config.token_px // CELL_PX, 2 * config.refinement.border_cells
    cells = (f"{side}*rows", f"{side}*columns")
    width = widths(config.refinement.channels)[0]
    border = output("border", "batch", channels, *(f"{axis}+{margin}" for axis in cells))
    return (
        output("gaussians", "batch", channels, KEYS, *_pixels(config)),
        output("tokens", "batch", width, KEYS, *cells),
        *((border,) if margin else ()),
    )


def _optical_flow(config: ModelConfig) -> GraphSource:
    image, flow = (("pairs", channels, *_pixels(config)) for channels in (3, 2))
    return GraphSource(
        name="ldrm_optical_flow",
        part="ldrm",
        module=TensorFunction(nn.Identity(), lambda _, *images: optical_flow(*images)),
        inputs=(unit("source", *image), unit("target", *image), normal("start", *flow)),
        outputs=(output("flow", *flow),),
    )


def _pixels(config: ModelConfig) -> tuple[Axis, Axis]:
    return f"{config.token_px}*rows", f"{config.token_px}*columns"


def _grid(config: ModelConfig) -> tuple[Axis, Axis]:
    """The grid of Gaussians."""
    side = config.token_px // config.ldrm.grid_stride
    return f"{side}*rows", f"{side}*columns"
