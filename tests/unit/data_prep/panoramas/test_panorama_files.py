"""Photographs cut from panoramas, as files."""

from pathlib import Path

import numpy as np
import OpenEXR
import pytest
from PIL import Image

from diff4splat.data_prep.panoramas.cut import (
    MID_LEVEL,
    SHOULDER,
    PanoramaJob,
    cut_panoramas,
    exposed,
    random_views,
    read_panorama,
)
from diff4splat.errors import FileFormatError, InputError
from diff4splat.io.photos.images import read_photo
from diff4splat.progress.phases import Phases


def write_panorama(file: Path, sides: tuple[int, int] = (32, 64)) -> Path:
    file.parent.mkdir(exist_ok=True)
    levels = np.random.default_rng(0).integers(0, 256, (*sides, 3), dtype=np.uint8)
    Image.fromarray(levels).save(file)
    return file


def job(tmp_path: Path, *panoramas: Path, **settings: int) -> PanoramaJob:
    return PanoramaJob(panoramas=panoramas, folder=tmp_path / "out", **settings)


def test_views_all_around_are_written_and_repeat_exactly(tmp_path: Path) -> None:
    wanted = job(tmp_path, write_panorama(tmp_path / "room.png"), views=6, size_px=16)
    assert cut_panoramas(wanted, Phases()) == 6
    files = sorted((tmp_path / "out").iterdir())
    assert [file.name for file in files] == [f"room-{number:03d}.png" for number in range(6)]
    before = [file.read_bytes() for file in files]
    cut_panoramas(wanted, Phases())
    assert before == [file.read_bytes() for file in files]
    assert read_photo(files[0]).rgb.shape == (16, 16, 3)
    assert len(set(before)) == 6


def test_views_differ_by_seed_and_panorama_and_look_all_around(tmp_path: Path) -> None:
    first = job(tmp_path, views=8)
    yaws = [view.yaw_deg for view in random_views(first, 0)]
    assert all(45 * place <= yaw < 45 * (place + 1) for place, yaw in enumerate(yaws))
    assert random_views(first, 0) != random_views(first, 1)
    assert random_views(first, 0) != random_views(job(tmp_path, views=8, seed=1), 0)


def test_views_of_one_colour_are_left_out(tmp_path: Path) -> None:
    plain = tmp_path / "plain.png"
    Image.new("RGB", (64, 32), (90, 90, 90)).save(plain)
    assert cut_panoramas(job(tmp_path, plain, size_px=16), Phases()) == 0


def test_radiance_is_exposed_whatever_its_unit(tmp_path: Path) -> None:
    radiance = np.random.default_rng(1).gamma(1.0, 1.0, (32, 64, 3)).astype(np.float32)
    shown = exposed(radiance)
    np.testing.assert_allclose(exposed(radiance * 1000), shown, atol=1e-4)
    assert shown.min() >= 0 and shown.max() <= 1
    middle = (MID_LEVEL / (1 + SHOULDER * MID_LEVEL)) ** (1 / 2.2)
    assert float(np.quantile(shown, 0.7)) == pytest.approx(middle, abs=0.01)
    file = tmp_path / "sky.exr"
    with OpenEXR.File({"type": OpenEXR.scanlineimage}, {"RGB": radiance}) as image:
        image.write(str(file))
    np.testing.assert_allclose(read_panorama(file) / 255, shown, atol=0.01)


@pytest.mark.parametrize("value", [0.0, np.nan, -1.0, np.inf, 1e30])
def test_exposure_of_extreme_radiance_is_finite(value: float) -> None:
    shown = exposed(np.full((4, 8, 3), value, np.float32))
    assert np.isfinite(shown).all() and shown.min() >= 0 and shown.max() <= 1


def test_an_image_of_other_sides_is_refused_and_nothing_is_written(tmp_path: Path) -> None:
    files = (write_panorama(tmp_path / "a.png"), write_panorama(tmp_path / "b.png", (32, 48)))
    with pytest.raises(FileFormatError, match=r"b\.png: expected a panorama .* got 48 x 32"):
        cut_panoramas(job(tmp_path, *files), Phases())
    assert not list((tmp_path / "out").glob("*.png"))


def test_two_panoramas_of_one_name_are_refused(tmp_path: Path) -> None:
    files = [write_panorama(tmp_path / folder / "room.png") for folder in ("one", "two")]
    with pytest.raises(InputError, match="got 2 called room"):
        cut_panoramas(job(tmp_path, *files), Phases())
