"""What rendering leaves to the user; its approximations are measured on seeded scenes.

Those are in ``diff4splat.error_time``, with the scenes that show them: a haze of nearly transparent
Gaussians, footprints below a pixel, a shutter that reads while everything turns.
"""

from diff4splat.approximations.declaration import Approximation, UserChoices
from diff4splat.render.physical.settings import PhotoSettings
from diff4splat.render.settings import RenderSettings
from diff4splat.render.trace.settings import TraceSettings

APPROXIMATIONS: tuple[Approximation, ...] = ()

USER_CHOICES: UserChoices = {
    "RenderSettings.background": "what lies behind the scene: asked for",
    "RenderSettings.alpha_max": "part of the image model that scenes are fitted with",
    "RenderSettings.near_depth": "what is too near to be drawn: asked for",
    "RenderSettings.memory_bytes": "how much is done at a time; changes no pixel",
    "RenderSettings.flow_camera": "where the flow ends: asked for",
    "RenderSettings.flow_time_s": "when the flow ends: asked for",
    "RenderSettings.features": "what is blended: asked for",
    "TraceSettings.kernel_degree": "the model that a scene was fitted with: another scene",
    "TraceSettings.alpha_cutoff": "as RenderSettings.alpha_cutoff, which is measured",
    "TraceSettings.alpha_max": "part of the image model that scenes are fitted with",
    "TraceSettings.near_distance": "what is too near to be there: asked for",
    "TraceSettings.min_response": "the model that a scene was fitted with",
    "TraceSettings.color_direction": "the model that a scene was fitted with",
    "TraceSettings.background": "what lies behind the scene: asked for",
    "TraceSettings.memory_bytes": "how much is done at a time; changes no pixel",
    "PhotoSettings.seed": "which of the equally good samples are taken",
    "PhotoSettings.pixel_area": "whether a pixel is a point or a square: asked for",
    "PhotoSettings.smoothing_px2": "what a scene was made for, as RenderSettings.dilation_px2",
    "PhotoSettings.most_intervals": "a limit; the error that remains is reported",
    "PhotoSettings.trace": "the settings of the tracer, each of its own",
    "PhotoSettings.raster": "the settings of the rasteriser, each of its own",
    "PhotoSettings.memory_bytes": "how much is done at a time; changes no pixel",
}
"""Fields that change results, and approximate nothing."""

SETTINGS_CLASSES = (RenderSettings, TraceSettings, PhotoSettings)
"""Whose fields are all named above or by a measured setting."""
