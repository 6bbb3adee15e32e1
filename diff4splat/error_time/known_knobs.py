"""The knobs that come with the library; other packages register theirs beside them."""

from diff4splat.error_time import camera_knobs, flow_knobs, network_knobs, render_knobs, scene_knobs
from diff4splat.error_time.declared import ALL_INPUTS, References, declared_settings
from diff4splat.error_time.knobs import ApproximationSetting, KnobRegistry

_BUILDERS = (
    flow_knobs.sampler_knob,
    flow_knobs.guided_sampler_knob,
    flow_knobs.levels_knob,
    flow_knobs.guidance_knob,
    scene_knobs.pruning_knob,
    scene_knobs.harmonics_knob,
    render_knobs.tile_knob,
    render_knobs.support_knob,
    render_knobs.light_knob,
    render_knobs.dilation_knob,
    render_knobs.precision_knob,
    camera_knobs.chunk_knob,
    camera_knobs.aperture_knob,
    camera_knobs.exposure_knob,
    camera_knobs.trace_light_knob,
)


def register_known_knobs(registry: KnobRegistry, inputs: tuple[int, ...] = ALL_INPUTS) -> None:
    """Add every knob to ``registry``; those of the shipped networks run on ``inputs``."""
    for build in _BUILDERS:
        registry.register(build())
    references = References(inputs=inputs)
    for setting in (*declared_settings(references), *network_knobs.network_settings(references)):
        registry.register(setting)


def known_knobs() -> tuple[ApproximationSetting, ...]:
    """All of them."""
    registry = KnobRegistry()
    register_known_knobs(registry)
    return registry.knobs()
