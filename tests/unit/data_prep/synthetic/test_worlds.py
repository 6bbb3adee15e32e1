import numpy as np
import pytest
import torch
from made_worlds import COUNT, SPLITS, made_world

from diff4splat.captions.grammar import parse_caption
from diff4splat.data_prep.synthetic.actors import camera_direction
from diff4splat.data_prep.synthetic.splits import load_split
from diff4splat.data_prep.synthetic.world import World, WorldObject
from diff4splat.data_prep.synthetic.worlds import WorldRecipe, make_world
from diff4splat.errors import ConfigError
from diff4splat.geometry.camera import project
from diff4splat.geometry.rigid import require_rigid
from diff4splat.paths.camera_path import CameraPath, require_valid_path

PLACES = {"floor", "wall", "skirting", "ground", "rug", "table"}
every_world = pytest.mark.parametrize(
    ("split", "index"), [(split, index) for split in SPLITS for index in range(COUNT)]
)


def moving(made: World) -> list[WorldObject]:
    return [thing for thing in made.objects if len(thing.positions) > 1]


def boxes_of(made: World) -> dict[int, tuple[np.ndarray, np.ndarray]]:
    """Bounds over all frames of what has a body of its own."""
    names = {note.instance: note.name for note in made.note.objects}
    return {
        thing.instance: (thing.positions.min((0, 1)), thing.positions.max((0, 1)))
        for thing in made.objects
        if names[thing.instance] not in PLACES
    }


@every_world
def test_worlds_are_well_formed(split: str, index: int) -> None:
    made = made_world(split, index)
    assert [thing.instance for thing in made.objects] == list(range(1, len(made.objects) + 1))
    assert len(made.objects) <= 254 and len(made.note.objects) == len(made.objects)
    assert sum(len(thing.mesh.triangles) for thing in made.objects) < 27_000
    for thing in made.objects:
        assert thing.positions.shape[0] in (1, 17)
        assert thing.positions.shape[1:] == thing.mesh.rest.shape
        assert len(thing.mesh.uv) == len(thing.mesh.rest)
        assert thing.mesh.triangles.max() < len(thing.mesh.rest)
        assert np.isfinite(thing.positions).all()
        assert (thing.positions * 2.0**14 % 1 == 0).all()
        assert 2 <= len(thing.texture.colors) <= 4
        assert (thing.texture.colors > 0).all() and (thing.texture.colors < 1).all()
        assert thing.texture.scale > 0 and 0 <= thing.texture.seed < 2**32
    assert np.linalg.norm(made.light.toward) == pytest.approx(1.0, abs=1e-6)
    assert made.light.toward[1] < -0.1


@every_world
def test_cameras_are_rigid_and_clear(split: str, index: int) -> None:
    made = made_world(split, index)
    assert len(made.views) == 3
    eyes = np.concatenate([view.position.numpy() for view in made.views])
    for view in made.views:
        assert view.world_from_camera.dtype == torch.float64
        require_rigid(view.world_from_camera, "view", tolerance=1e-8)
        require_valid_path(CameraPath(cameras=view, times_s=torch.from_numpy(made.times_s)), "view")
    for low, high in boxes_of(made).values():
        outside = np.maximum(np.maximum(low - eyes, eyes - high), 0)
        assert np.linalg.norm(outside, axis=1).min() > 0
    assert eyes[:, 1].max() < 0


@every_world
def test_what_moves_is_seen_and_said(split: str, index: int) -> None:
    made = made_world(split, index)
    facts = parse_caption(made.note.caption)
    assert made.note.is_static == (not moving(made)) == (not facts.events)
    size = torch.tensor([128.0, 128.0], dtype=torch.float64)
    notes = {note.instance: note for note in made.note.objects}
    told = [notes[thing.instance].motion for thing in moving(made)]
    assert all(told)
    for thing in moving(made):
        pixels, z = project(made.views[0][0], torch.from_numpy(thing.positions[0]))
        inside = (z > 0) & ((pixels > 0) & (pixels < size)).all(-1)
        assert inside.double().mean() > 0.5
        assert thing.positions[..., 1].max() < 1e-4


def pixel_path(made: World, thing: WorldObject) -> float:
    """How far to the right the middle of a thing goes, seen by the camera of the first frame."""
    middle = torch.from_numpy(thing.positions.mean(1))
    pixels, _ = project(made.views[0][0], middle)
    return float(pixels[-1, 0] - pixels[0, 0])


def test_left_and_right_are_what_the_first_camera_sees() -> None:
    checked = 0
    for made in (made_world(split, index) for split in SPLITS for index in range(COUNT)):
        notes = {note.instance: note.motion for note in made.note.objects}
        for thing in moving(made):
            words = notes[thing.instance]
            if words.endswith("to the left") or words.endswith("to the right"):
                assert (pixel_path(made, thing) > 0) == words.endswith("right"), words
                checked += 1
    assert checked >= 12


def test_directions_are_measured() -> None:
    camera = made_world("training", 0).views[0]
    right, ahead = (
        camera.world_from_camera[0, :3, 0].numpy(),
        camera.world_from_camera[0, :3, 2].numpy(),
    )
    still = np.zeros((1, 5, 3))

    def seen(way: np.ndarray) -> str:
        return camera_direction((np.concatenate([still, still + way]),), camera)

    assert seen(right) == "right" and seen(-right) == "left"
    assert seen(ahead) == "away" and seen(-ahead) == "toward"
    assert seen(right + ahead) == "" and seen(0 * right) == ""


def test_worlds_do_not_depend_on_what_was_made_before() -> None:
    first = made_world("training", 5)
    made_world("training", 6)
    again = make_world(WorldRecipe(), 5)
    assert first.note == again.note
    for one, other in zip(first.objects, again.objects, strict=True):
        assert one.positions.tobytes() == other.positions.tobytes()
    assert make_world(WorldRecipe(seed=4), 5).note.caption != first.note.caption


def test_still_worlds_have_a_moving_camera() -> None:
    for index in range(5):
        made = make_world(WorldRecipe(still_share=1.0, frames=5, views=1), index)
        assert made.note.is_static and not moving(made)
        poses = made.views[0].world_from_camera
        changes = (poses - poses[:1]).abs().amax() + made.views[0].focal_px.diff(dim=0).abs().amax()
        assert float(changes) > 1e-3


def test_held_out_worlds_show_something_new() -> None:
    split, train = load_split("held_out"), load_split("training")
    for index in range(COUNT):
        made = made_world("held_out", index)
        assert {thing.texture.family for thing in made.objects} & split.textures.new
        events = parse_caption(made.note.caption).events
        if events:
            assert {event.motion for event in events} & split.motions.new
    for index in range(COUNT):
        made = made_world("training", index)
        assert {thing.texture.family for thing in made.objects} <= set(train.textures.names)
        assert {e.motion for e in parse_caption(made.note.caption).events} <= set(
            train.motions.names
        )


def test_overrides_choose_what_is_made() -> None:
    recipe = WorldRecipe(
        families=("ball", "box"), motions=("rolls",), scenes=("room",), palettes=("slate",),
        still_share=0.0, frames=5, views=1, size_px=(48, 64),
    )  # fmt: skip
    made = make_world(recipe, 0)
    assert {e.motion for e in parse_caption(made.note.caption).events} == {"rolls"}
    assert len(made.views) == 1 and len(made.times_s) == 5
    assert made.views[0].size_px == (48, 64)
    assert {note.name for note in made.note.objects} & {"ball"}


def test_recipes_that_cannot_be_made(as_shipped: None) -> None:
    for broken, words in (
        ({"frames": 0}, "frames"), ({"views": 0}, "views"), ({"size_px": (4, 128)}, "size_px"),
        ({"still_share": 1.5}, "still_share"), ({"fps": 0.0}, "fps"),
    ):  # fmt: skip
        with pytest.raises(ConfigError, match=words):
            WorldRecipe(**broken)
    with pytest.raises(ConfigError, match="index"):
        make_world(WorldRecipe(), -1)
    with pytest.raises(ConfigError, match="unicorn"):
        make_world(WorldRecipe(families=("unicorn",)), 0)
    with pytest.raises(ConfigError, match="attempts"):
        make_world(WorldRecipe(families=("box",), motions=("rolls",), still_share=0.0), 0)
