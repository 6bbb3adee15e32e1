"""Cutouts as files: names, pictures with transparency, and the colour that they are called."""

import json
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from diff4splat.captions.cutout_nouns import ALL_NOUNS, CUTOUT_NOUNS
from diff4splat.captions.synonyms import names
from diff4splat.captions.vocabulary import UNSEEN_NOUNS
from diff4splat.data_prep.cutouts.cutout import (
    MOST_SIDE_PX,
    PUBLIC_NAMES,
    Cutout,
    find_cutouts,
    main_color,
    read_cutout,
    read_names,
)
from diff4splat.errors import FileFormatError, InputError


def write_picture(file: Path, color: str = "red", other: str = "red") -> Path:
    """A square of 20 of 40 pixels, its lower half in another colour, before nothing."""
    image = Image.new("RGBA", (40, 40))
    image.paste(Image.new("RGBA", (20, 20), color), (5, 10))
    image.paste(Image.new("RGBA", (20, 10), other), (5, 20))
    image.save(file)
    return file


def test_empty_borders_are_cut_and_colours_named(tmp_path: Path) -> None:
    cutout = read_cutout(write_picture(tmp_path / "a.png"), "apple")
    assert cutout.noun == "apple" and cutout.rgba.shape == (20, 20, 4)
    assert main_color(cutout) == "red"
    other = read_cutout(write_picture(tmp_path / "b.webp", "blue", "blue"), "ball")
    assert main_color(other) == "blue" and other.rgba.shape == (20, 20, 4)


def test_an_object_of_several_colours_has_no_colour() -> None:
    stripes = Image.new("RGBA", (32, 30), "red")
    for place, color in enumerate(("green", "blue")):
        stripes.paste(Image.new("RGBA", (32, 10), color), (0, 10 * (1 + place)))
    rgba = np.asarray(stripes, np.float32) / 255
    assert main_color(Cutout(noun="ball", rgba=rgba)) == ""
    nothing = np.zeros((4, 4, 4), np.float32)
    assert main_color(Cutout(noun="ball", rgba=nothing)) == ""


@pytest.mark.parametrize("kind", ["opaque", "empty", "text"])
def test_what_is_no_cutout_is_refused(tmp_path: Path, kind: str) -> None:
    file = tmp_path / "a.png"
    if kind == "text":
        file.write_text("no picture")
    else:
        Image.new("RGB" if kind == "opaque" else "RGBA", (8, 8)).save(file)
    with pytest.raises(FileFormatError, match="expected"):
        read_cutout(file, "apple")


@pytest.mark.parametrize(
    "text", ["{", "[]", '{"a": 1}', '{"a": "contraption"}'], ids=["json", "list", "number", "noun"]
)
def test_tables_that_are_none_are_refused(tmp_path: Path, text: str) -> None:
    file = tmp_path / "names.json"
    file.write_text(text)
    with pytest.raises(FileFormatError, match="expected"):
        read_names(file)


def test_pictures_without_a_name_are_passed_over(tmp_path: Path) -> None:
    write_picture(tmp_path / "a.png"), write_picture(tmp_path / "b.png")
    assert find_cutouts(tmp_path, {"b": "apple"}) == {"apple": [tmp_path / "b.png"]}
    with pytest.raises(InputError, match="got none of 1"):
        find_cutouts(tmp_path, {"c": "apple"})


@pytest.mark.parametrize("package", PUBLIC_NAMES)
def test_tables_of_public_cutouts_name_no_family_of_test_worlds(package: str) -> None:
    file = PUBLIC_NAMES[package]
    table = read_names(file)
    assert len(table) > 500 and set(table.values()) <= set(ALL_NOUNS)
    hidden = {name for noun in UNSEEN_NOUNS for name in names(noun)}
    assert hidden.isdisjoint(table.values())
    assert list(table) == sorted(table) == list(json.loads(file.read_text()))


def test_every_noun_of_cutouts_has_one() -> None:
    tables = [read_names(file) for file in PUBLIC_NAMES.values()]
    assert set(CUTOUT_NOUNS) <= {noun for table in tables for noun in table.values()}


def test_cutouts_of_subfolders_are_found_and_large_ones_reduced(tmp_path: Path) -> None:
    (tmp_path / "fruit").mkdir()
    large = Image.new("RGBA", (700, 350), (255, 0, 0, 255))
    large.save(tmp_path / "fruit" / "a.png")
    (file,) = find_cutouts(tmp_path, {"fruit/a": "apple"})["apple"]
    cutout = read_cutout(file, "apple")
    assert cutout.rgba.shape == (MOST_SIDE_PX // 2, MOST_SIDE_PX, 4)
    assert np.allclose(cutout.rgba, [1, 0, 0, 1], atol=1e-5)
