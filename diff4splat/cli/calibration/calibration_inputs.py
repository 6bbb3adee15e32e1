"""Fixed inputs of a calibration: drawn worlds, a small capture, and photographs of the user.

Of a fit, a scene is made in which everything moves.
"""

import shutil
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

WORLDS = ((11, 0), (19, 5))
"""(seed, index) of worlds of the test split, which no model was trained on."""
SIDE_PX, TIMES, TRACKS = 256, 5, 8
PROMPT = "a rounded block slides to the left"
CAPTURES = {
    "capture": ("--rig", "--size", "64", "--frames", "9", "--views", "5", "--clips", "1"),
    "large-capture": ("--rig", "--size", "128", "--frames", "3", "--views", "5", "--clips", "1"),
}
"""Folder to options: clips that fits learn from. Two sizes, as pixels have a rate of their own."""
WIDE_GAUSSIANS = 20_000


def draw_photos(folder: Path, worlds: Sequence[tuple[int, int]] = WORLDS) -> list[Path]:
    """The first frame of each world as a PNG."""
    from diff4splat.data_prep.synthetic.renderer.clips import draw_clip
    from diff4splat.data_prep.synthetic.renderer.settings import DrawSettings
    from diff4splat.data_prep.synthetic.worlds import WorldRecipe, make_world
    from diff4splat.io.photos.images import write_png

    files = []
    for seed, index in worlds:
        recipe = WorldRecipe(
            seed=seed,
            split="held_out",
            still_share=0.0,
            frames=TIMES,
            size_px=(SIDE_PX, SIDE_PX),
            views=1,
        )
        clip = draw_clip(make_world(recipe, index), DrawSettings(tracks=TRACKS, flow=False))
        files.append(folder / f"world-{seed}-{index}.png")
        write_png(clip.views[0].rgb[0].float() / 255, files[-1])
    return files


def widen_scene(source: Path, file: Path) -> Path:
    """A fitted scene in which everything moves, and much of it: copies of its Gaussians."""
    import torch

    from diff4splat.io.scene_files.scene_file import load_scene, save_scene

    scene = load_scene(source)
    count = len(scene.gaussians)
    index = torch.arange(WIDE_GAUSSIANS) % count
    motion = replace(scene.motion, moving_index=torch.arange(WIDE_GAUSSIANS))
    save_scene(replace(scene, gaussians=scene.gaussians.select(index), motion=motion), file)
    return file


def copy_photos(folder: Path, photos: Sequence[Path]) -> list[Path]:
    """The user's photographs beside them, under their own names."""
    return [Path(shutil.copy(photo, folder / photo.name)) for photo in photos]
