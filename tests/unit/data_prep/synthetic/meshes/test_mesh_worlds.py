"""Worlds with meshes: arrangements, furnished places, cutouts."""

import json
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
from obj_meshes import write_library

from diff4splat.data_prep.synthetic.arrangements import arrangement
from diff4splat.data_prep.synthetic.arrangements.backdrops import Backdrop
from diff4splat.data_prep.synthetic.arrangements.cameras import eye_of
from diff4splat.data_prep.synthetic.arrangements.furnished import (
    GAP_M,
    HEIGHTS_M,
    Furniture,
    furnish,
)
from diff4splat.data_prep.synthetic.arrangements.handheld_cameras import EYE_M, handheld_view
from diff4splat.data_prep.synthetic.arrangements.objects import arrange
from diff4splat.data_prep.synthetic.cameras import LensSpec
from diff4splat.data_prep.synthetic.materials import image_texture, named_color
from diff4splat.data_prep.synthetic.meshes.cutouts import MeshCutoutJob, cutout, draw_cutouts
from diff4splat.data_prep.synthetic.meshes.library import MeshLibrary, open_library
from diff4splat.data_prep.synthetic.meshes.prepare import MeshJob, prepare_meshes
from diff4splat.data_prep.synthetic.renderer.clips import draw_clip
from diff4splat.data_prep.synthetic.renderer.settings import DrawSettings
from diff4splat.data_prep.synthetic.rng import Rng
from diff4splat.data_prep.synthetic.shapes.shape import PartImage
from diff4splat.data_prep.synthetic.world import Texture
from diff4splat.data_prep.synthetic.worlds import WorldRecipe, make_world
from diff4splat.errors import ConfigError, InputError
from diff4splat.progress.phases import Phases

pytest.importorskip("trimesh")
COUNT = 6
ROOM = Backdrop(objects=(), half_m=(2.0, 2.5), height_m=2.4, is_open=False)
OPEN = Backdrop(objects=(), half_m=(9.0, 9.0), height_m=9.0, is_open=True)
FAST = DrawSettings(tracks=0, flow=False, samples_per_side=1, shadow_px=64)


@pytest.fixture(scope="module")
def file(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("library")
    source = write_library(folder / "things.sh3f", ("Armchair", "Cat", "Table", "Unknown"))
    job = MeshJob(sources=[source], file=folder / "meshes.safetensors", license="CC-BY-3.0")
    prepare_meshes(job, Phases())
    return folder / "meshes.safetensors"


@pytest.fixture(scope="module")
def library(file: Path) -> MeshLibrary:
    return open_library(file)


def recipe(file: Path, **settings) -> WorldRecipe:
    small = {"seed": 5, "frames": 1, "views": 3, "size_px": (32, 32), "arrangements": True}
    return WorldRecipe(**small | {"meshes": file, "mesh_share": 1.0} | settings)


def test_arrangements_have_meshes_and_say_their_licences(file: Path, library: MeshLibrary) -> None:
    made = make_world(recipe(file), 0)
    assert any(item.texture.image is not None for item in made.objects)
    assert made.note.license == "CC-BY-3.0"
    assert made.note.identifier.endswith(f"-mesh100-0-{library.digest}")


def test_images_repeat_by_the_height_of_the_object_and_name_its_colour() -> None:
    image = PartImage(
        pixels=np.full((128, 128, 3), 90, np.uint8), repeats=2.0, gloss=0.1, color="blue"
    )
    texture = image_texture(image, 0.5)
    assert texture.scale == pytest.approx(4.0)
    assert named_color(texture) == "blue"
    assert named_color(image_texture(replace(image, color=""), 0.5)) == ""
    plain = Texture(family="plain", colors=np.full((2, 3), 0.9), scale=1.0, seed=0)
    assert named_color(plain) == "white"


def test_equal_recipes_give_equal_bits(file: Path) -> None:
    for settings in ({}, {"mesh_share": 0.0, "furnished_share": 1.0}):
        one, two = (draw_clip(make_world(recipe(file, **settings), 1), FAST) for _ in range(2))
        for view, other in zip(one.views, two.views, strict=True):
            assert (view.rgb == other.rgb).all() and (view.depth == other.depth).all()


def test_without_a_share_no_world_changes(file: Path) -> None:
    plain = WorldRecipe(seed=5, frames=1, views=3, size_px=(32, 32), arrangements=True)
    made = make_world(recipe(file, mesh_share=1e-12), 0)
    expected = make_world(plain, 0)
    for item, other in zip(made.objects, expected.objects, strict=True):
        assert (item.positions == other.positions).all()


@pytest.fixture(scope="module", params=[ROOM, OPEN], ids=["room", "open"])
def furniture(request, library: MeshLibrary) -> tuple[Backdrop, list[list[Furniture]]]:
    backdrop = request.param
    return backdrop, [furnish(library, backdrop, Rng("test", n)) for n in range(COUNT)]


def test_furniture_has_natural_size_and_stands(furniture) -> None:
    backdrop, places = furniture
    assert all(places) and max(map(len, places)) > 4
    for items in places:
        for item in items:
            assert 0.8 * 0.5 < item.placed.shape.height < 1.2 * 0.5
            assert HEIGHTS_M[0] <= item.placed.shape.height <= HEIGHTS_M[1]
            assert item.high_m[1] < 1e-9
            if not backdrop.is_open:
                assert (np.abs([item.low_m, item.high_m])[:, [0, 2]] < backdrop.half_m).all()


def test_furniture_does_not_overlap(furniture) -> None:
    for items in furniture[1]:
        for number, one in enumerate(items):
            for other in items[:number]:
                gap = np.maximum(one.low_m - other.high_m, other.low_m - one.high_m)
                assert gap.max() > -1e-5


def test_some_furniture_has_its_back_to_a_wall_and_faces_the_room(library: MeshLibrary) -> None:
    backs = 0
    for number in range(COUNT):
        for item in furnish(library, ROOM, Rng("wall", number)):
            for axis, half in zip((0, 2), ROOM.half_m, strict=True):
                for side, face in ((-1, item.low_m), (1, item.high_m)):
                    if abs(side * face[axis] - half + GAP_M) < 1e-6:
                        backs += 1
                        assert _front(item)[axis] == pytest.approx(-side, abs=1e-6)
    assert backs >= COUNT


def _front(item: Furniture) -> np.ndarray:
    """Unit vector from the middle to the pictured side."""
    way = item.placed.parts[0][0].mean(0) - item.center_m
    return way / np.linalg.norm(way)


def test_what_is_higher_than_the_room_does_not_stand_in_it(library: MeshLibrary) -> None:
    low = replace(ROOM, height_m=0.4)
    assert not any(furnish(library, low, Rng("low", number)) for number in range(3))


@pytest.mark.parametrize("backdrop", [ROOM, OPEN], ids=["room", "open"])
def test_cameras_are_at_the_height_of_people_and_in_no_object(
    library: MeshLibrary, backdrop: Backdrop
) -> None:
    objects = furnish(library, backdrop, Rng("cameras", 0))
    views = [handheld_view(objects, backdrop, Rng("view", number)) for number in range(60)]
    eyes = np.array([eye_of(view) for view in views if view is not None])
    assert len(eyes) > 40
    assert (-eyes[:, 1] > EYE_M[0]).all() and (-eyes[:, 1] < EYE_M[1]).all()
    for item in objects:
        away = np.maximum(item.low_m - eyes, eyes - item.high_m).max(1)
        assert away.min() >= 0.06 - 1e-9
    if not backdrop.is_open:
        assert (np.abs(eyes[:, [0, 2]]) < backdrop.half_m).all()


def test_rooms_are_lit_as_rooms(file: Path) -> None:
    rooms, others = [], []
    for index in range(2 * COUNT):
        made = make_world(recipe(file, mesh_share=0.0, furnished_share=1.0), index)
        walls = sum(note.name == "panel" for note in made.note.objects)
        (rooms if walls >= 5 else others).append(made.sky.haze_per_m == made.sky.clouds == 0)
    assert rooms and others and all(rooms) and not all(others)


def test_most_meshes_of_arrangements_are_upright(file: Path) -> None:
    split, upright = recipe(file).allowed(), []
    for number in range(30):
        for item in arrange(split, Rng("up", number), is_portrait=False, is_high=False):
            points = np.concatenate([part[0] for part in item.placed.parts])
            upright.append(np.ptp(points[:, 1]) == pytest.approx(item.placed.shape.height))
    assert 0.7 < np.mean(upright) < 0.9


def test_small_objects_lie_on_others(library: MeshLibrary) -> None:
    small = MeshLibrary(library.file)
    small.__dict__["notes"] = tuple(
        note.__class__(**{**{k: getattr(note, k) for k in note.__slots__}, "height_m": height})
        for note, height in zip(library.notes, (0.8, 0.8, 0.1, 0.1), strict=True)
    )
    lifted = [
        item
        for number in range(COUNT)
        for item in furnish(small, OPEN, Rng("small", number))
        if item.high_m[1] < -0.3
    ]
    assert lifted and all(item.placed.shape.height < 0.2 for item in lifted)


def test_furnished_places_have_depth_everywhere_near_and_named_objects(file: Path) -> None:
    names = set()
    for index in range(COUNT):
        made = make_world(recipe(file, mesh_share=0.0, furnished_share=1.0), index)
        names |= {note.name for note in made.note.objects}
        for view in draw_clip(made, FAST).views:
            depth = view.depth[view.depth > 0]
            assert len(depth) and float(depth.min()) > 0.02
    assert {"chair", "cat", "table", "object"} <= names


@pytest.mark.parametrize(
    "settings",
    [{"mesh_share": 0.0}, {"arrangements": False}, {"meshes": None}, {"mesh_share": 1.5}],
)
def test_recipes_that_contradict_themselves_are_refused(file: Path, settings: dict) -> None:
    with pytest.raises(ConfigError, match="mesh"):
        recipe(file, **settings)


def test_a_cutout_is_opaque_inside_and_transparent_around(library: MeshLibrary) -> None:
    rgba = cutout(library.shape(0), 48, Rng("cutout", 1))
    assert max(rgba.shape[:2]) <= 48 and rgba.shape[2] == 4
    assert (rgba[..., 3] == 255).mean() > 0.3
    solid = rgba[rgba[..., 3] == 255][:, :3].astype(int)
    assert solid.std(0).max() > 20 and solid.mean() > 15
    assert (rgba[0][:, 3] > 0).any() and (rgba[:, 0, 3] > 0).any()
    # Colours at the edge are those of the object, not mixed with what is around it.
    edge = rgba[(rgba[..., 3] > 60) & (rgba[..., 3] < 200)][:, :3]
    assert edge.max(1).mean() > 0.75 * solid.max(1).mean()


def test_cutouts_of_known_names_are_written_with_their_nouns(file: Path, tmp_path: Path) -> None:
    job = MeshCutoutJob(meshes=file, folder=tmp_path / "out", views=2, size_px=32)
    assert draw_cutouts(job, Phases()) == 6
    names = json.loads((tmp_path / "out" / "names.json").read_text())
    assert sorted(set(names.values())) == ["cat", "chair", "table"]
    for name in names:
        image = cv2.imread(str(tmp_path / "out" / f"{name}.png"), cv2.IMREAD_UNCHANGED)
        assert image.shape[2] == 4


def test_a_library_without_known_names_gives_no_cutouts(tmp_path: Path) -> None:
    source = write_library(tmp_path / "things.sh3f", ("Unknown",))
    file = tmp_path / "meshes.safetensors"
    prepare_meshes(MeshJob(sources=[source], file=file, license="MIT"), Phases())
    with pytest.raises(InputError, match="noun of captions"):
        draw_cutouts(MeshCutoutJob(meshes=file, folder=tmp_path / "out"), Phases())
    assert not (tmp_path / "out").exists()


def test_a_place_without_room_for_every_camera_is_given_up(file: Path, monkeypatch) -> None:
    views = iter([None, *range(99)])
    seen = arrangement.handheld_view

    def sometimes(*arguments):
        return None if next(views) is None else seen(*arguments)

    monkeypatch.setattr(arrangement, "handheld_view", sometimes)
    split = recipe(file, mesh_share=0.0, furnished_share=1.0).allowed()
    lens = LensSpec(size_px=(32, 32), fov_deg=50.0, frames=1, fps=1.0)
    assert arrangement.try_arrangement(split, lens, 3, Rng("given up", 0), "a") is None
    assert arrangement.try_arrangement(split, lens, 3, Rng("given up", 0), "a") is not None
