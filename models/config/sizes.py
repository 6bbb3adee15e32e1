"""The sizes of a model: ``test`` for tests, ``small`` for two CPU cores, ``paper`` as published."""

from collections.abc import Callable, Mapping
from types import MappingProxyType

from diff4splat.errors import ConfigError
from diff4splat.models.config.model import (
    ActivationConfig,
    DeformationConfig,
    DitConfig,
    ImageInpaintingConfig,
    LdrmConfig,
    ModelConfig,
    MonocularDepthConfig,
    MotionUNetConfig,
    ObjectMaskConfig,
    ObjectShadowConfig,
    RefinementConfig,
    TextConfig,
    VaeConfig,
)


def test_size() -> ModelConfig:
    """Runs in milliseconds with random weights; never trained."""
    return ModelConfig(
        name="test",
        frames=5,
        size_px=(32, 32),
        vae=VaeConfig(latent_channels=4, widths=(4, 6, 8), pixel_patch=2),
        text=TextConfig(width=16, blocks=1, heads=2, feedforward_width=32),
        dit=DitConfig(
            width=24, blocks=2, heads=2, feedforward_width=48, frequency_width=16, camera_width=8
        ),
        ldrm=LdrmConfig(width=24, heads=2, feedforward_width=48, blocks=2, embed_channels=8),
        deformation=DeformationConfig(width=16, level_widths=(8, 6, 4), time_frequencies=4),
        activation=ActivationConfig(),
    )


test_size.__test__ = False
"""pytest must not take the factory for a test."""


def small_size() -> ModelConfig:
    """42 million weights: runs on two CPU cores in seconds, and can be trained there."""
    return ModelConfig(
        name="small",
        frames=9,
        size_px=(64, 64),
        vae=VaeConfig(latent_channels=128, widths=(32, 64, 96), pixel_patch=2, pca_shortcut=True),
        text=TextConfig(width=128, blocks=3, heads=4, feedforward_width=256),
        dit=DitConfig(
            width=256,
            blocks=8,
            heads=4,
            feedforward_width=768,
            camera_width=64,
            prediction_type="clean",
            render_condition=True,
            pooled_text=True,
        ),
        ldrm=LdrmConfig(width=128, heads=4, feedforward_width=384, blocks=8),
        deformation=DeformationConfig(
            width=64, blocks=3, time_frequencies=3, static_threshold_px=4.0
        ),
        activation=ActivationConfig(),
        refinement=RefinementConfig(channels=48, depth_prior=True),
        monocular_depth=MonocularDepthConfig(
            channels=32,
            photo_scale=2,
            image_backbone=True,
            backbone_size="lite2",
            uncertainty=True,
        ),
        motion_unet=MotionUNetConfig(width=64, mask_refiner_width=32, input_scale=2),
        object_mask=ObjectMaskConfig(
            width=24, image_backbone=True, instance_channels=12, image_classifier=True
        ),
        image_inpainting=ImageInpaintingConfig(widths=(64, 128, 256, 512, 512, 512, 512, 512)),
        object_shadow=ObjectShadowConfig(width=32),
        default_fill="none",
        default_guidance=1.0,
    )


def paper_size() -> ModelConfig:
    """The published numbers where there are any; for the meta device and for clusters."""
    return ModelConfig(
        name="paper",
        frames=49,
        size_px=(512, 512),
        vae=VaeConfig(latent_channels=32, widths=(96, 192, 384, 384), blocks=2),
        text=TextConfig(width=4096, blocks=24, heads=64, feedforward_width=10240),
        dit=DitConfig(width=4096, blocks=32, heads=32, feedforward_width=16384, camera_width=1024),
        ldrm=LdrmConfig(width=1024, heads=16, feedforward_width=4096),
        deformation=DeformationConfig(width=512, blocks=4, level_widths=(192, 96, 48)),
        activation=ActivationConfig(),
    )


SIZES: Mapping[str, Callable[[], ModelConfig]] = MappingProxyType(
    {"test": test_size, "small": small_size, "paper": paper_size}
)
"""Every size by name."""


def size_by_name(name: str) -> ModelConfig:
    """The configuration of a named size.

    Raises:
        ConfigError: there is no such size.
    """
    if name not in SIZES:
        raise ConfigError(f"network size: expected {', '.join(SIZES)}, got {name!r}")
    return SIZES[name]()
