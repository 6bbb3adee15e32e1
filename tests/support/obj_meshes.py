"""Small OBJ meshes with materials and images, in folders and in libraries of Sweet Home 3D."""

import io
import zipfile
from pathlib import Path

import numpy as np
from PIL import Image

CUBE = """\
mtllib cube.mtl
v -1 0 -1
v 1 0 -1
v 1 4 -1
v -1 4 -1
v -1 0 1
v 1 0 1
v 1 4 1
v -1 4 1
vt 0 0
vt 1 0
vt 1 1
vt 0 1
usemtl pictured
f 5/1 6/2 7/3 8/4
usemtl red
f 1 4 3 2
f 1 5 8 4
usemtl blue
f 2 3 7 6
f 4 8 7 3
f 1 2 6 5
"""
MATERIALS = """\
newmtl pictured
Kd 1 1 1
map_Kd front.png
newmtl red
Kd 1 0 0
Ns 500
newmtl blue
Kd 0 0 1
"""


def front_image() -> np.ndarray:
    """Green above, white below."""
    image = np.full((16, 16, 3), 255, np.uint8)
    image[:8] = (0, 200, 0)
    return image


def cube_files(obj: str = CUBE, materials: str = MATERIALS) -> dict[str, bytes]:
    """A box of 2 × 4 × 2 with an image in front (+z), two red and three blue sides."""
    stream = io.BytesIO()
    Image.fromarray(front_image()).save(stream, "PNG")
    return {
        "cube.obj": obj.encode(),
        "cube.mtl": materials.encode(),
        "front.png": stream.getvalue(),
    }


def write_cube(folder: Path, name: str = "cube", **changed: str) -> Path:
    """The box as files of a folder, called ``name``."""
    folder.mkdir(parents=True, exist_ok=True)
    for file, content in cube_files(**changed).items():
        (folder / file.replace("cube.obj", f"{name}.obj")).write_bytes(content)
    return folder


def write_library(file: Path, names: tuple[str, ...] = ("Armchair", "Cat")) -> Path:
    """The box under several names, each 50 cm high."""
    lines = ["id=test"]
    with zipfile.ZipFile(file, "w") as archive:
        for number, name in enumerate(names, 1):
            lines += [
                f"name#{number}={name}",
                f"model#{number}=/things/{number}/cube.obj",
                f"height#{number}=50",
                f"creator#{number}=Somebody",
            ]
            for inside, content in cube_files().items():
                archive.writestr(f"things/{number}/{inside}", content)
        archive.writestr("PluginFurnitureCatalog.properties", "\n".join(lines))
    return file
