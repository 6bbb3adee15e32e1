"""Where the bytes of scene files go, and what their compression costs in quality.

Usage: python benchmarks/scene_bytes.py SCENE [SCENE ...]

Give scenes that were written with ``--compression lossless``; others have lost their bits already.
"""

import argparse
import tempfile
import time
from collections import Counter
from pathlib import Path

from diff4splat.io.scene_files.scene_file import load_scene, save_scene
from diff4splat.io.scene_files.tensor_file import read_tensors
from diff4splat.outputs.compressed_scene import worst_view_psnr_db
from diff4splat.scene.scene import Scene

COMPRESSIONS = ("lossless", "standard", "small")


def part(name: str) -> str:
    """The tensor of the scene that a stored tensor belongs to."""
    if name.startswith("hexplane."):
        return "HexPlane"
    return "path" if name.startswith("path_") else name.split(".", maxsplit=1)[0]


def measure(scene: Scene, folder: Path) -> tuple[dict[str, Counter], dict[str, str]]:
    """Bytes by tensor and compression, and a line about each file."""
    sizes, lines = {}, {}
    for compression in COMPRESSIONS:
        file, start_s = folder / f"{compression}.safetensors", time.perf_counter()
        save_scene(scene, file, compression)
        written_s = time.perf_counter()
        back = load_scene(file)
        read_s = time.perf_counter() - written_s
        sizes[compression] = Counter()
        for name, value in read_tensors(file).items():
            sizes[compression][part(name)] += value.nbytes
        sizes[compression]["file"] = file.stat().st_size
        psnr_db = worst_view_psnr_db(scene, back)
        lines[compression] = f"{psnr_db:.1f} dB, written in {written_s - start_s:.1f} s"
        lines[compression] += f", read in {read_s:.1f} s"
    return sizes, lines


def main() -> None:
    """One table per scene."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("scenes", type=Path, nargs="+")
    for file in parser.parse_args().scenes:
        scene = load_scene(file)
        with tempfile.TemporaryDirectory() as folder:
            sizes, lines = measure(scene, Path(folder))
        whole = sizes["lossless"]["file"]
        print(f"\n{file}: {len(scene.gaussians):,} Gaussians\n")
        print(f"| kB | {' | '.join(COMPRESSIONS)} |\n|---|{'---:|' * len(COMPRESSIONS)}")
        for name in sizes["lossless"]:
            cells = [f"{sizes[one][name] / 1e3:,.1f}" for one in COMPRESSIONS]
            print(f"| {name} | {' | '.join(cells)} |")
        shares = [f"{sizes[one]['file'] / whole:.1%}" for one in COMPRESSIONS]
        print(f"| share | {' | '.join(shares)} |\n| | {' | '.join(lines.values())} |")


if __name__ == "__main__":
    main()
