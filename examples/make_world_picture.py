"""Write the first picture of a procedural world, and say what moves there; nothing is downloaded.

Usage: python examples/make_world_picture.py picture.jpg [--world 3] [--seed 7] [--side 256]

Worlds are of the held-out split: no model of this project was trained on them.
"""

import argparse
import shutil
from pathlib import Path

from PIL import Image

from diff4splat.data_prep.synthetic.renderer.clips import draw_clip
from diff4splat.data_prep.synthetic.renderer.settings import DrawSettings
from diff4splat.data_prep.synthetic.worlds import WorldRecipe, make_world
from diff4splat.geometry.camera import Camera, focal_from_35mm

EXIF_IFD, EXIF_FOCAL_35MM = 0x8769, 0xA405


def focal_35mm(camera: Camera) -> int:
    """The 35 mm equivalent by the diagonal, as EXIF means it."""
    return round(float(camera.focal_px[0]) / focal_from_35mm(1.0, camera.size_px))


def main() -> None:
    """Draw a short clip of the world and keep its first picture."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("out", type=Path)
    parser.add_argument("--world", type=int, default=3)
    parser.add_argument("--seed", type=int, default=7)
    parser.add_argument("--side", type=int, default=256)
    options = parser.parse_args()
    recipe = WorldRecipe(
        seed=options.seed,
        split="held_out",
        still_share=0.0,
        frames=5,
        size_px=(options.side, options.side),
        views=1,
    )
    clip = draw_clip(make_world(recipe, options.world), DrawSettings(tracks=8, flow=False))
    picture = Image.fromarray(clip.views[0].rgb[0].numpy())
    exif = picture.getexif()
    exif.get_ifd(EXIF_IFD)[EXIF_FOCAL_35MM] = focal_35mm(clip.views[0].cameras[0])
    options.out.parent.mkdir(parents=True, exist_ok=True)
    temporary = options.out.with_name(f".{options.out.name}.partial")
    picture.save(temporary, format="JPEG", quality=97, exif=exif)
    shutil.move(temporary, options.out)
    print(f"wrote {options.out}: {clip.note.caption}")


if __name__ == "__main__":
    main()
