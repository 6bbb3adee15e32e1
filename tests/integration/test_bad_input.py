"""Everything a person can hand in wrong: one line, exit code 2, files left as they were."""

import os
import resource
import signal
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import torch
from PIL import Image

from diff4splat.cli.main import run
from diff4splat.io.photos.images import write_png

Spoil = Callable[[Path], Path]


@pytest.fixture
def photo(tmp_path: Path) -> Path:
    write_png(torch.rand(40, 40, 3), tmp_path / "photo.png")
    return tmp_path / "photo.png"


def generate(image: Path, out: Path, *more: str) -> int:
    arguments = ["generate", str(image), "--out", str(out), "--model", "test", "--frames", "2"]
    return run([*arguments, "--steps", "1", *more])


def assert_refused(code: int, capsys: pytest.CaptureFixture, *words: str) -> None:
    """Exit code 2 and a last line that names the trouble."""
    assert code == 2
    lines = [
        line for line in capsys.readouterr().err.splitlines() if line.startswith("diff4splat:")
    ]
    assert len(lines) == 1
    for word in words:
        assert word in lines[0], lines[0]


def pixels(*shape: int) -> np.ndarray:
    return np.random.default_rng(0).integers(0, 255, shape, dtype=np.uint8)


def missing(folder: Path) -> Path:
    return folder / "nowhere.png"


def empty(folder: Path) -> Path:
    (folder / "empty.png").touch()
    return folder / "empty.png"


def truncated(folder: Path) -> Path:
    Image.fromarray(pixels(64, 64, 3)).save(folder / "whole.jpg")
    content = (folder / "whole.jpg").read_bytes()
    (folder / "cut.jpg").write_bytes(content[: len(content) // 2])
    return folder / "cut.jpg"


def not_an_image(folder: Path) -> Path:
    (folder / "text.png").write_text("hello")
    return folder / "text.png"


def sixteen_bit(folder: Path) -> Path:
    Image.fromarray(pixels(40, 40).astype(np.uint16) * 257).save(folder / "deep.png")
    return folder / "deep.png"


def grey(folder: Path) -> Path:
    Image.fromarray(pixels(40, 40)).save(folder / "grey.png")
    return folder / "grey.png"


def with_alpha(folder: Path) -> Path:
    Image.fromarray(pixels(40, 40, 4)).save(folder / "alpha.png")
    return folder / "alpha.png"


def animated(folder: Path) -> Path:
    frames = [Image.fromarray(pixels(40, 40, 3) // (i + 1)) for i in range(3)]
    frames[0].save(folder / "moving.webp", save_all=True, append_images=frames[1:])
    return folder / "moving.webp"


def cmyk(folder: Path) -> Path:
    Image.fromarray(pixels(40, 40, 4), "CMYK").save(folder / "print.jpg")
    return folder / "print.jpg"


def enormous(folder: Path) -> Path:
    Image.new("RGB", (12000, 10000)).save(folder / "huge.png")
    return folder / "huge.png"


IMAGES = [
    (missing, "nowhere.png"),
    (empty, "empty"),
    (truncated, "cut.jpg"),
    (not_an_image, "text.png"),
    (sixteen_bit, "16-bit"),
    (grey, "grey"),
    (with_alpha, "alpha"),
    (animated, "animat"),
    (cmyk, "CMYK"),
    (enormous, "megapixel"),
]


@pytest.mark.filterwarnings("ignore:.*mode.*parameter:DeprecationWarning")
@pytest.mark.parametrize(("spoil", "word"), IMAGES, ids=[spoil.__name__ for spoil, _ in IMAGES])
def test_images(spoil: Spoil, word: str, tmp_path: Path, capsys: pytest.CaptureFixture) -> None:
    image, out = spoil(tmp_path), tmp_path / "out"
    assert_refused(generate(image, out), capsys, "expected", word)
    assert not out.exists()


@pytest.mark.filterwarnings("ignore:.*mode.*parameter:DeprecationWarning")
@pytest.mark.parametrize("spoil", [sixteen_bit, grey, with_alpha, animated, cmyk])
def test_convert_accepts_what_can_be_converted(spoil: Spoil, tmp_path: Path) -> None:
    assert generate(spoil(tmp_path), tmp_path / "out", "--convert", "--skip-depth") == 0


POSE = "1 0 0 0 0 1 0 0 0 0 1 0"
MIRRORED = "1 0 0 0 0 1 0 0 0 0 -1 0"
PATHS = {
    "nan": ("0 0.8 1.2 0.5 0.5 0 0 nan" + POSE[1:], "finite"),
    "left-handed": (f"0 0.8 1.2 0.5 0.5 0 0 {MIRRORED}", "right-handed"),
    "columns": ("0 0.8 1.2 0.5 0.5 0 0 1 0 0", "columns"),
    "no poses": ("https://example.com/video", "expected"),
    "empty": ("", "empty"),
    "json of another kind": ('{"camera": 3}', "expected"),
    "broken json": ('{"frames": [', "expected"),
}


@pytest.mark.parametrize("name", PATHS)
def test_path_files(name: str, photo: Path, tmp_path: Path, capsys: pytest.CaptureFixture) -> None:
    content, word = PATHS[name]
    file = tmp_path / "path.txt"
    file.write_text(content)
    assert_refused(generate(photo, tmp_path / "out", "--camera", str(file)), capsys, word)
    assert_refused(
        run(["paths", "preview", str(file), "--out", str(tmp_path / "p.png")]), capsys, word
    )
    assert not (tmp_path / "out").exists()
    assert not (tmp_path / "p.png").exists()


def test_an_unknown_preset_suggests_the_nearest(
    photo: Path, tmp_path: Path, capsys: pytest.CaptureFixture
) -> None:
    assert_refused(generate(photo, tmp_path / "out", "--camera", "spiarl"), capsys, "spiral")
    assert_refused(generate(photo, tmp_path / "out", "--camera", "gone.txt"), capsys, "gone.txt")


@pytest.mark.parametrize(
    ("prompt", "word"), [("", "none"), ("   ", "none"), ("x" * 10_000, "10000")]
)
def test_prompts(
    prompt: str, word: str, photo: Path, tmp_path: Path, capsys: pytest.CaptureFixture
) -> None:
    code = generate(photo, tmp_path / "out", "--prompt", prompt)
    assert_refused(code, capsys, "prompt", "expected", word)


@pytest.mark.parametrize(
    ("options", "word"),
    [
        (("--steps", "0"), "steps"),
        (("--fov", "400"), "--fov"),
        (("--fps", "nan"), "fps"),
        (("--frames", "0"), "frames"),
        (("--guidance", "-1"), "guidance"),
        (("--guidance", "nan"), "guidance"),
        (("--shift", "0"), "shift"),
        (("--seed", "-1"), "--seed"),
        (("--seed", "99999999999999999999999"), "--seed"),
        (("--min-opacity", "2"), "opacity"),
        (("--resolution", "3"), "--resolution"),
        (("--model", "enormous"), "enormous"),
        (("--model", "paper"), "GiB"),
        (("--camera", "forward", "--amplitude", "5"), "near"),
    ],
)
def test_settings(
    options: tuple[str, ...], word: str, photo: Path, tmp_path: Path, capsys: pytest.CaptureFixture
) -> None:
    assert_refused(generate(photo, tmp_path / "out", *options), capsys, "expected", word)
    assert not (tmp_path / "out").exists()


def test_a_file_where_the_folder_should_be(
    photo: Path, tmp_path: Path, capsys: pytest.CaptureFixture
) -> None:
    (tmp_path / "out").write_text("mine")
    assert_refused(generate(photo, tmp_path / "out"), capsys, "choose another folder")
    assert_refused(generate(photo, tmp_path / "out" / "below"), capsys, "choose another folder")
    assert (tmp_path / "out").read_text() == "mine"


def test_an_unwritable_folder(photo: Path, capsys: pytest.CaptureFixture) -> None:
    assert_refused(generate(photo, Path("/proc/diff4splat")), capsys, "expected to write here")


def small_files_only() -> None:
    """Like a disk that is nearly full: no file may grow beyond 3 kB."""
    resource.setrlimit(resource.RLIMIT_FSIZE, (3000, 3000))


def command(*arguments: str) -> list[str]:
    return [sys.executable, "-m", "diff4splat.cli.main", *arguments]


def test_a_full_folder_keeps_the_files_that_were_there(photo: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    out.mkdir()
    (out / "scene.safetensors").write_text("an older scene")
    done = subprocess.run(
        command("generate", str(photo), "--out", str(out), "--model", "test", "--frames", "2"),
        preexec_fn=small_files_only,
        capture_output=True,
        text=True,
        env=os.environ | {"PYTHONDONTWRITEBYTECODE": "1"},
        check=False,
    )
    assert done.returncode == 2, done.stderr
    assert "Traceback" not in done.stderr
    assert [file.name for file in out.iterdir()] == ["scene.safetensors"]
    assert (out / "scene.safetensors").read_text() == "an older scene"


STOPPED_IN_A_PHASE = """
import contextlib, signal, sys
from diff4splat.cli.common import console
from diff4splat.cli.main import main

number, stopped_phase = int(sys.argv.pop(1)), sys.argv.pop(1)
bar = console.ConsolePhases.bar


@contextlib.contextmanager
def stopping_bar(self, name, steps):
    with bar(self, name, steps) as advance:
        if name == stopped_phase:
            signal.raise_signal(number)
        yield advance


console.ConsolePhases.bar = stopping_bar
main()
"""


@pytest.mark.parametrize(
    ("stop", "phase"),
    [
        (signal.SIGINT, "write files"),
        pytest.param(signal.SIGTERM, "render", marks=pytest.mark.slow),
    ],
)
def test_an_interrupt_leaves_nothing_half_written(
    stop: signal.Signals, phase: str, photo: Path, tmp_path: Path
) -> None:
    out = tmp_path / "out"
    arguments = ["generate", str(photo), "--out", str(out), "--model", "test", "--frames", "2"]
    done = subprocess.run(
        [sys.executable, "-c", STOPPED_IN_A_PHASE, str(int(stop)), phase, *arguments],
        stderr=subprocess.PIPE,
        text=True,
        check=False,
    )
    assert done.returncode == 130, done.stderr
    assert phase in done.stderr
    assert "no half-written file" in done.stderr
    assert "Traceback" not in done.stderr
    assert not out.exists()
    assert run(arguments) == 0, "the same command works afterwards"


def test_scene_files(tmp_path: Path, photo: Path, capsys: pytest.CaptureFixture) -> None:
    from safetensors.torch import save_file

    assert generate(photo, tmp_path / "out") == 0
    whole = (tmp_path / "out" / "scene.safetensors").read_bytes()
    spoiled = {
        "missing": None,
        "truncated": whole[: len(whole) // 2],
        "newer": whole.replace(b'"version":"1"', b'"version":"9"'),
        "text": b"not a scene",
        "empty": b"",
    }
    capsys.readouterr()
    for name, content in spoiled.items():
        file = tmp_path / f"{name}.safetensors"
        if content is not None:
            file.write_bytes(content)
        assert content != whole
        assert_refused(run(["render", str(file), "--out", str(tmp_path / "x.png")]), capsys, name)
    save_file({"weight": torch.zeros(3)}, tmp_path / "other.safetensors")
    assert_refused(run(["inspect", str(tmp_path / "other.safetensors")]), capsys, "other")
    assert not (tmp_path / "x.png").exists()


@pytest.mark.parametrize(
    ("arguments", "word"),
    [
        (("--out", "view.avi"), ".mp4"),
        (("--frame", "99", "--out", "view.png"), "--frame"),
        (("--resolution", "0"), "--resolution"),
    ],
)
def test_render_settings(
    arguments: tuple[str, ...],
    word: str,
    photo: Path,
    tmp_path: Path,
    capsys: pytest.CaptureFixture,
) -> None:
    assert generate(photo, tmp_path / "out") == 0
    capsys.readouterr()
    code = run(["render", str(tmp_path / "out" / "scene.safetensors"), *arguments])
    assert_refused(code, capsys, "expected", word)


def test_an_input_is_never_overwritten(tmp_path: Path, capsys: pytest.CaptureFixture) -> None:
    write_png(torch.rand(40, 40, 3), tmp_path / "preview.png")
    before = (tmp_path / "preview.png").read_bytes()
    code = generate(tmp_path / "preview.png", tmp_path)
    assert_refused(code, capsys, "another place than the input")
    assert (tmp_path / "preview.png").read_bytes() == before
    scene = tmp_path / "scene.png"
    scene.write_bytes(b"a scene")
    assert_refused(run(["render", str(scene), "--out", str(scene)]), capsys, "another place")
    assert scene.read_bytes() == b"a scene"


def test_a_folder_in_the_way_of_one_file_keeps_all_the_others(
    photo: Path, tmp_path: Path, capsys: pytest.CaptureFixture
) -> None:
    out = tmp_path / "out"
    (out / "video.mp4").mkdir(parents=True)
    (out / "card.json").write_text("older")
    assert_refused(generate(photo, out), capsys, "video.mp4", "a folder stands")
    assert (out / "card.json").read_text() == "older"
    assert {file.name for file in out.iterdir()} == {"video.mp4", "card.json"}


@pytest.mark.parametrize("option", ["--camera", "--model", "--out"])
def test_names_longer_than_any_file(
    option: str, photo: Path, tmp_path: Path, capsys: pytest.CaptureFixture
) -> None:
    arguments = ["generate", str(photo), "--out", str(tmp_path / "out"), "--model", "test"]
    assert_refused(run([*arguments, "--frames", "2", option, "x" * 300]), capsys, "expected")


def test_names_that_are_not_text(
    photo: Path, tmp_path: Path, capsys: pytest.CaptureFixture
) -> None:
    assert_refused(generate(photo, tmp_path / "o\udcff"), capsys, "UTF-8")


def test_nothing_left_to_show_and_a_preview_that_is_no_image(
    photo: Path, tmp_path: Path, capsys: pytest.CaptureFixture
) -> None:
    assert_refused(generate(photo, tmp_path / "out", "--min-opacity", "1"), capsys, "leaves some")
    preview = ["paths", "preview", "spiral", "--out", str(tmp_path / "p.xyz")]
    assert_refused(run(preview), capsys, ".png")
    assert_refused(run(["inspect", "--config", ""]), capsys, "expected")
    assert list(tmp_path.iterdir()) == [photo]
