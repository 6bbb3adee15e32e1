"""The scenes of the gallery: photographs, drawn worlds, fits, lenses.

Steps are arguments of a program, in order. ``{gallery}`` is the gallery's folder, ``{out}`` the
item's own.
"""

from dataclasses import dataclass

DIFF4SPLAT, WORLD_PICTURE, PHOTO = "diff4splat", "world picture", "photo"


@dataclass(frozen=True, slots=True, kw_only=True)
class Item:
    """One scene of the gallery."""

    name: str
    """Of its folder."""
    group: str
    title: str
    text: str
    """What a visitor should look at."""
    steps: tuple[tuple[str, ...], ...]
    scene: str = ""
    """Item whose viewer page is linked; empty: its own."""


def _photograph(name: str, camera: str, text: str) -> Item:
    return Item(
        name=name,
        group="One photograph",
        title=name.capitalize(),
        text=text,
        steps=(
            (PHOTO, name, "{out}/photo.png"),
            (DIFF4SPLAT, "generate", "{out}/photo.png", "--camera", camera, *_COMMON),
        ),
    )


def _world(number: int, camera: str, prompt: str) -> Item:
    generate = ("generate", "{out}/photo.jpg", "--camera", camera, "--prompt", prompt)
    return Item(
        name=f"world-{number}",
        group="One image and a prompt",
        title=f"“{prompt}”",
        text="An image of a drawn world that no training has used. The prompt says what moves.",
        steps=(
            (WORLD_PICTURE, "{out}/photo.jpg", "--world", str(number)),
            (DIFF4SPLAT, *generate, *_COMMON),
        ),
    )


def _fit(motion: str, title: str, text: str) -> Item:
    clips = "{out}/clips"
    return Item(
        name=f"fit-{motion}",
        group="Fitted to video of ten cameras",
        title=title,
        text=text,
        steps=(
            (DIFF4SPLAT, "prepare", "synth", "--out", clips, "--clips", "1", "--rig", *_CLIP),
            (DIFF4SPLAT, "fit", clips, "--motion", motion, "--out", "{out}", *_FIT),
        ),
    )


def _lens(name: str, of: str, title: str, text: str, *options: str) -> Item:
    scene = f"{{gallery}}/{of}/scene.safetensors"
    view = ("--resolution", "320", "--frames", "16", "--out", "{out}/video.webm")
    return Item(
        name=name,
        group="Through other lenses",
        title=title,
        text=text,
        steps=((DIFF4SPLAT, "render", scene, *options, *view),),
        scene=of,
    )


_COMMON = ("--resolution", "256", "--skip-depth", "--video", "webm", "--out", "{out}")
_CLIP = ("--size", "96", "--frames", "13", "--views", "10", "--seed", "7", "--motions", "slides")
_CLIP += ("rolls", "hops", "drives", "rises", "bounces")
_FIT = ("--budget", "12000", "--steps", "600", "--set", "coarse_steps=400")

ITEMS = (
    _photograph("coffee", "arc:0.15", "The cup stands off the table; the spoon keeps its place."),
    _photograph("astronaut", "spiral", "Helmet, face and flag lie at different depths."),
    _photograph("chelsea", "arc:0.1", "A face close to the camera: ears behind the nose."),
    _photograph("rocket", "arc:0.2", "Thin towers before the sky, the hard case of one image."),
    _world(3, "arc:0.2", "a turquoise rounded block slides to the left"),
    _world(12, "spiral", "the orange star moves to the left"),
    _world(4, "arc:0.15", "the blue ball moves to the right"),
    _world(0, "arc:0.1", "the green caterpillar creeps to the left"),
    _fit("hexplane", "HexPlane field", "A field over space and time deforms the Gaussians."),
    _fit("spacetime", "Native 4D Gaussians", "Each Gaussian has a velocity and a duration."),
    _lens("fisheye", "astronaut", "Fisheye, 150 degrees", "The same scene, by ray tracing.",
          "--lens", "fisheye", "--fov", "150"),
    _lens("depth-of-field", "coffee", "Depth of field", "Only spoon and handle are sharp.",
          "--aperture-radius", "0.08", "--focus-distance", "2.4", "--samples", "16"),
)  # fmt: skip
