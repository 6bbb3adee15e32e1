"""OBJ files become meshes of height 1 with images, or are skipped with a reason."""

import io
import json
import zipfile
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from obj_meshes import CUBE, MATERIALS, cube_files, write_cube, write_library
from PIL import Image

from diff4splat.captions.cutout_nouns import ALL_NOUNS
from diff4splat.data_prep.synthetic.meshes import obj_parts, obj_sources
from diff4splat.data_prep.synthetic.meshes.library import NOUNS_FILE, MeshLibrary, open_library
from diff4splat.data_prep.synthetic.meshes.main_color import main_color
from diff4splat.data_prep.synthetic.meshes.obj_parts import ObjPart, read_obj
from diff4splat.data_prep.synthetic.meshes.palette import (
    CELLS,
    MOST_IMAGES,
    TexturedPart,
    area,
    textured_parts,
)
from diff4splat.data_prep.synthetic.meshes.prepare import TEST_WORDS, MeshJob, prepare_meshes
from diff4splat.data_prep.synthetic.rng import Rng
from diff4splat.data_prep.synthetic.shapes.surfaces.surface import merged, signed_volume
from diff4splat.errors import FileFormatError, InputError, MissingExtraError
from diff4splat.io.scene_files.tensor_file import TensorFile, write_tensors
from diff4splat.progress.phases import Phases

pytest.importorskip("trimesh")


WIRE = CUBE.replace("v 1", "v 0.01").replace("v -1", "v -0.01").replace(" -1\n", " -0.99\n")
WIRE = WIRE.replace(" 1\nv", " -0.98\nv").replace(" 4 1\nvt", " 4 -0.98\nvt")
FLAT = CUBE.replace("1 4 1", "1 0 1").replace("1 4 -1", "1 0 -1")


def made(source: Path, file: Path, **settings):
    return prepare_meshes(
        MeshJob(sources=[source], file=file, license="CC-BY-3.0", **settings), Phases()
    )


@pytest.fixture(scope="module")
def library(tmp_path_factory) -> MeshLibrary:
    folder = tmp_path_factory.mktemp("library")
    report = made(write_library(folder / "things.sh3f"), folder / "meshes.safetensors")
    assert report.written == 2 and report.reasons == ""
    return open_library(folder / "meshes.safetensors")


def test_the_index_says_what_the_catalogue_says(library: MeshLibrary) -> None:
    assert [note.name for note in library.notes] == ["armchair", "cat"]
    for note in library.notes:
        assert (note.creator, note.license) == ("Somebody", "CC-BY-3.0")
        assert note.height_m == pytest.approx(0.5)
    assert [library.noun(number) for number in range(2)] == ["chair", "cat"]
    assert library.licenses == ("CC-BY-3.0",) and len(library.digest) == 8


def test_shapes_have_height_one_and_stand_on_the_ground(library: MeshLibrary) -> None:
    low, high = library.shape(0).bounds
    np.testing.assert_allclose(low, [-0.25, -1.0, -0.25], atol=1e-6)
    np.testing.assert_allclose(high, [0.25, 0.0, 0.25], atol=1e-6)
    assert library.shape(0).triangles == 12


def test_the_front_faces_x_with_its_image_upright(library: MeshLibrary) -> None:
    front = library.shape(0).parts[0]
    assert front.image is not None
    np.testing.assert_allclose(front.surface.vertices[:, 0], 0.25, atol=1e-6)
    # In repeats of the image: the top of the box has the first row.
    uv = front.surface.uv * front.image.repeats
    top = front.surface.vertices[:, 1] < -0.5
    np.testing.assert_allclose(uv[top, 1], 0.0, atol=1e-6)
    np.testing.assert_allclose(uv[~top, 1], 1.0, atol=1e-6)
    assert tuple(front.image.pixels[0, 0]) == (0, 200, 0)
    assert tuple(front.image.pixels[-1, -1]) == (255, 255, 255)


def test_triangles_face_outward(library: MeshLibrary) -> None:
    parts = [part.surface for part in library.shape(0).parts]
    assert signed_volume(merged(*parts)) == pytest.approx(0.25, rel=1e-5)


def test_repeats_follow_from_areas(library: MeshLibrary) -> None:
    # One repeat on 0.5 x 1: as if the image were a square of the same area.
    assert library.shape(0).parts[0].image.repeats == pytest.approx(1 / np.sqrt(0.5), rel=1e-5)


def test_materials_without_image_share_a_palette(library: MeshLibrary) -> None:
    palette = library.shape(0).parts[1]
    uv = palette.surface.uv * palette.image.repeats
    cells = (uv * palette.image.pixels.shape[0]).astype(int)
    colors = palette.image.pixels[cells[:, 1], cells[:, 0]]
    # In the middle of a cell, so that no neighbour is mixed in.
    np.testing.assert_allclose(uv * CELLS % 1, 0.5, atol=1e-3)
    assert {tuple(color) for color in colors} == {(255, 0, 0), (0, 0, 255)}
    assert palette.image.gloss > 0.1


def test_the_main_colour_is_that_of_most_of_the_surface(library: MeshLibrary) -> None:
    # Of 40 square units 16 are red, 16 blue, 8 pictured.
    assert library.notes[0].color == ""
    red, blue, green = (_plain(color) for color in ((200, 30, 30), (20, 40, 170), (40, 110, 50)))
    assert main_color([blue]) == "blue"
    assert main_color([blue, red, green]) == ""
    assert main_color([blue, red, blue]) == "blue"


def test_colours_are_looked_up_by_column_and_row() -> None:
    (part,) = textured_parts([_part(0, pictured=True)])
    image = np.full((128, 128, 3), (200, 30, 30), np.uint8)
    image[:, 64:] = (20, 40, 170)
    uv = np.array([[0.0, 0.5], [0.3, 0.5], [0.2, 1.0]], np.float32)
    assert main_color([replace(part, image=image, uv=uv)]) == "red"


def _plain(color: tuple[int, int, int]) -> TexturedPart:
    (part,) = textured_parts([_part(0, pictured=True)])
    return replace(part, image=np.full((128, 128, 3), color, np.uint8))


def _part(number: int, pictured: bool) -> ObjPart:
    return ObjPart(
        vertices=np.eye(3, dtype=np.float32) * (1 + number),
        triangles=np.array([[0, 1, 2]]),
        uv=np.array([[0, 0], [1, 0], [0, 1]], np.float32),
        color=np.array([number, 0, 0], np.uint8),
        image=np.full((128, 128, 3), number, np.uint8) if pictured else None,
        gloss=0.5,
    )


def test_only_the_largest_images_stay() -> None:
    parts = textured_parts([_part(number, pictured=True) for number in range(MOST_IMAGES + 2)])
    kept = [int(part.image[0, 0, 0]) for part in parts[:-1]]
    assert kept == [6, 5, 4, 3, 2] and len(parts) == MOST_IMAGES + 1
    assert len(parts[-1].triangles) == 2


def test_a_palette_holds_as_many_colours_as_it_has_cells() -> None:
    (palette,) = textured_parts([_part(n, pictured=False) for n in range(CELLS * CELLS + 3)])
    assert np.isfinite(palette.uv).all() and palette.uv.max() < 1
    assert len(palette.triangles) == CELLS * CELLS + 3
    assert palette.triangles.max() == len(palette.vertices) - 1


def test_areas_of_flat_and_empty_triangles() -> None:
    corners = np.array([[0, 0, 0], [2, 0, 0], [0, 2, 0]], np.float32)
    assert area(corners, np.array([[0, 1, 2]])) == pytest.approx(2.0)
    assert area(corners, np.array([[0, 0, 0]])) == 0.0


def test_transparent_materials_and_outlines_are_left_out() -> None:
    files = cube_files(materials=MATERIALS.replace("Ns 500", "d 0.3"))
    assert len(read_obj(files["cube.obj"], files)) == 2
    assert len(read_obj(cube_files()["cube.obj"], cube_files())) == 3


def _with_image(pixels: np.ndarray) -> dict[str, bytes]:
    stream = io.BytesIO()
    Image.fromarray(pixels).save(stream, "PNG")
    return cube_files() | {"front.png": stream.getvalue()}


def test_images_that_cut_an_outline_are_left_out() -> None:
    pixels = np.full((16, 16, 4), 255, np.uint8)
    pixels[:2, :2, 3] = 0
    files = _with_image(pixels)
    assert [part.image is None for part in read_obj(files["cube.obj"], files)].count(False) == 1
    pixels[:4, :4, 3] = 0
    files = _with_image(pixels)
    assert len(read_obj(files["cube.obj"], files)) == 2


def test_huge_images_are_refused(monkeypatch) -> None:
    monkeypatch.setattr(obj_parts, "MOST_IMAGE_PX", 255)
    with pytest.raises(FileFormatError, match="at most 255 pixels"):
        read_obj(cube_files()["cube.obj"], cube_files())


@pytest.mark.parametrize(
    ("name", "changed", "settings", "reason"),
    [
        ("mug of tea", {}, {}, "with a name of test worlds"),
        ("cube", {"obj": FLAT}, {}, "without a volume"),
        ("cube", {"obj": WIRE}, {}, "without a volume"),
        ("cube", {"obj": CUBE.replace("v 1 4 1", "v 1 nan 1")}, {}, "without a volume"),
        ("cube", {"obj": CUBE.replace("v 1 4 1", "v 1 1e38 1")}, {}, "without a volume"),
        ("cube", {"obj": CUBE.replace("f 1", "f 1000")}, {}, "damaged"),
        ("cube", {}, {"most_triangles": 11}, "with too many triangles"),
        (
            "cube",
            {"materials": MATERIALS.replace("Kd", "d 0.1\nKd")},
            {},
            "without opaque triangles",
        ),
        ("cube", {"obj": "v 0 0 0\n"}, {}, "without opaque triangles"),
    ],
)
def test_meshes_that_cannot_be_used_are_skipped_with_a_reason(
    tmp_path: Path, name: str, changed: dict, settings: dict, reason: str
) -> None:
    write_cube(tmp_path / "bad", name, **changed)
    write_cube(tmp_path / "good" / "inside")
    with pytest.raises(InputError, match=f"1 {reason}"):
        made(tmp_path / "bad", tmp_path / "meshes.safetensors", **settings)
    assert not (tmp_path / "meshes.safetensors").exists()


def test_a_folder_is_searched_with_its_subfolders(tmp_path: Path) -> None:
    write_cube(tmp_path / "source" / "one", "lamp shade")
    write_cube(tmp_path / "source" / "two", "stool")
    report = made(tmp_path / "source", tmp_path / "meshes.safetensors")
    assert report.written == 1 and report.reasons == "; skipped 1 with a name of test worlds"
    note = open_library(tmp_path / "meshes.safetensors").notes[0]
    assert note.name == "lamp shade" and note.height_m == pytest.approx(4.0)


def test_names_that_are_nouns_need_no_table(tmp_path: Path) -> None:
    write_cube(tmp_path / "source", "giraffe")
    made(tmp_path / "source", tmp_path / "meshes.safetensors")
    assert open_library(tmp_path / "meshes.safetensors").noun(0) == "giraffe"


def test_draws_are_even_over_names(library: MeshLibrary) -> None:
    drawn = [library.draw_number(Rng("draw", n)) for n in range(200)]
    assert 60 < drawn.count(0) < 140 and set(drawn) == {0, 1}


def test_folders_without_obj_files_are_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"expected \.obj files"):
        made(tmp_path, tmp_path / "meshes.safetensors")


@pytest.mark.parametrize("content", [b"", b"PK\x03\x04", b"no archive"])
def test_files_that_are_no_library_are_refused(tmp_path: Path, content: bytes) -> None:
    (tmp_path / "things.sh3f").write_bytes(content)
    with pytest.raises(FileFormatError, match="expected a ZIP file"):
        made(tmp_path / "things.sh3f", tmp_path / "meshes.safetensors")


def test_archives_without_a_catalogue_are_refused(tmp_path: Path) -> None:
    with zipfile.ZipFile(tmp_path / "things.sh3f", "w") as archive:
        archive.writestr("a.txt", "a")
    with pytest.raises(FileFormatError, match="Sweet Home 3D"):
        made(tmp_path / "things.sh3f", tmp_path / "meshes.safetensors")


def test_large_entries_of_an_archive_are_not_unpacked(tmp_path: Path, monkeypatch) -> None:
    monkeypatch.setattr(obj_sources, "MOST_BYTES", 10)
    source = write_library(tmp_path / "things.sh3f")
    with pytest.raises(InputError, match="got none"):
        made(source, tmp_path / "meshes.safetensors")


def test_other_tensor_files_are_refused(tmp_path: Path) -> None:
    file = tmp_path / "scene.safetensors"
    write_tensors(TensorFile(tensors={}, metadata={}), file)
    with pytest.raises(FileFormatError, match="prepare meshes"):
        open_library(file)


@pytest.mark.parametrize("index", ["", "[]", "[{}]", "7", '[{"name": "a"}]'])
def test_damaged_indices_are_refused(tmp_path: Path, index: str) -> None:
    file = tmp_path / "meshes.safetensors"
    metadata = {"format": "diff4splat-meshes-1", "index": index}
    write_tensors(TensorFile(tensors={}, metadata=metadata), file)
    with pytest.raises(FileFormatError, match="expected"):
        open_library(file)


def test_missing_tensors_are_said(library: MeshLibrary, tmp_path: Path) -> None:
    file = tmp_path / "meshes.safetensors"
    index = json.dumps(
        [{"name": "a", "creator": "", "license": "", "color": "", "height_m": 1.0, "parts": []}]
    )
    metadata = {"format": "diff4splat-meshes-1", "index": index}
    write_tensors(TensorFile(tensors={}, metadata=metadata), file)
    with pytest.raises(FileFormatError, match=r"expected tensor 0\.images"):
        open_library(file).shape(0)


def test_a_missing_package_is_one_clear_line(monkeypatch) -> None:
    def missing(name: str):
        raise ImportError(name)

    monkeypatch.setattr(obj_parts.importlib, "import_module", missing)
    with pytest.raises(MissingExtraError, match=r"pip install 'diff4splat\[meshes\]'"):
        read_obj(b"", {})


def test_nouns_of_the_table_are_known_and_of_no_test_family() -> None:
    nouns = json.loads(NOUNS_FILE.read_text(encoding="utf-8"))
    assert set(nouns.values()) <= set(ALL_NOUNS)
    assert not {word for noun in nouns.values() for word in noun.split()} & TEST_WORDS
    assert not {word for name in nouns for word in name.split()} & TEST_WORDS
