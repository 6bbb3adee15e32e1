"""Optics and ways of cameras through JSON: the same bits, and one line about whatever is wrong."""

import json
import math
from collections.abc import Callable

import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from diff4splat.errors import FileFormatError, InputError
from diff4splat.geometry import quaternion, rigid
from diff4splat.geometry.lenses.blender_fisheye import BLENDER_DEFAULT, BlenderFisheye
from diff4splat.geometry.lenses.equirectangular import Equirectangular
from diff4splat.geometry.lenses.opencv_fisheye import OpenCVFisheye
from diff4splat.geometry.lenses.opencv_pinhole import OpenCVPinhole
from diff4splat.geometry.lenses.pinhole import Pinhole
from diff4splat.geometry.optics import Aperture, Optics, Shutter
from diff4splat.geometry.pose_track import PoseTrack
from diff4splat.io.cameras.optics_json import optics_json, read_optics, read_track, track_json


def doubles(*values: float) -> torch.Tensor:
    return torch.tensor(values, dtype=torch.float64)


LENSES = [
    Pinhole(),
    OpenCVPinhole(
        radial=doubles(0.1, -0.02, 1 / 3, 0.0, 1e-9, 0.0),
        tangential=doubles(0.001, -math.pi / 1000),
        thin_prism=doubles(0.0, 1e-5, 0.0, 2e-5),
    ),
    OpenCVFisheye(coefficients=doubles(0.1, 0.0, -0.01, 1 / 7), max_angle_rad=math.pi / 2),
    OpenCVFisheye(coefficients=doubles(0.0, 0.0, 0.0, 0.0)),
    BlenderFisheye(coefficients=doubles(*BLENDER_DEFAULT), fov_rad=3.0),
    BlenderFisheye(coefficients=-doubles(*BLENDER_DEFAULT), cycles_signs=True),
    Equirectangular(),
]


def fields(lens: object) -> dict[str, object]:
    names = type(lens).__dataclass_fields__
    return {
        name: value.tolist() if isinstance(value, torch.Tensor) else value
        for name, value in ((name, getattr(lens, name)) for name in names)
    }


def through_text(value: object) -> object:
    return json.loads(json.dumps(value, allow_nan=False))


@pytest.mark.parametrize("lens", LENSES, ids=lambda lens: type(lens).__name__)
def test_every_lens_comes_back_bit_for_bit(lens) -> None:
    back = read_optics(through_text(optics_json(Optics(lens=lens))), "a.json").lens
    assert type(back) is type(lens)
    assert fields(back) == fields(lens)


@settings(deadline=None, max_examples=20)
@given(
    radius=st.floats(0, 1e3),
    focus=st.floats(1e-300, 1e6),
    readout=st.floats(0, 10),
    exposure=st.floats(0, 10),
)
def test_any_numbers_come_back_bit_for_bit(radius, focus, readout, exposure) -> None:
    optics = Optics(
        aperture=Aperture(radius=radius, focus_distance=focus, surface="sphere"),
        shutter=Shutter(readout_s=readout, direction="right-to-left"),
        exposure_s=exposure,
        timestamp="start",
    )
    back = read_optics(through_text(optics_json(optics)), "a.json")
    assert (back.aperture, back.shutter) == (optics.aperture, optics.shutter)
    assert (back.exposure_s, back.timestamp) == (exposure, "start")


def test_learned_numbers_are_written_as_they_stand() -> None:
    radius = torch.tensor(0.1, dtype=torch.float64, requires_grad=True)
    own = optics_json(Optics(aperture=Aperture(radius=radius, focus_distance=2.0)))
    assert own["aperture"] == {"radius": 0.1, "focus_distance": 2.0, "surface": "plane"}
    assert own["shutter"] is None


def test_the_formula_names_the_signs_of_blender_and_is_not_read() -> None:
    own = optics_json(Optics(lens=LENSES[5]))
    assert own["lens"]["cycles_signs"] is True
    assert "s = -1" in own["lens"]["formula"]
    del own["lens"]["formula"]
    assert read_optics(own, "a.json").lens.cycles_signs


class Odd:
    """A lens by its methods, of no known kind."""

    def directions(self, points):
        return points, points[..., 0] > 0

    points = directions

    def to(self, target):
        return self


def test_a_lens_of_another_kind_cannot_be_written() -> None:
    with pytest.raises(InputError, match="lens: expected one of pinhole, opencv"):
        optics_json(Optics(lens=Odd()))


def track(count: int = 3) -> PoseTrack:
    turn = quaternion.normalize(torch.randn(count, 4, dtype=torch.float64))
    poses = rigid.from_parts(
        quaternion.to_matrix(turn), torch.randn(count, 3, dtype=torch.float64) * 1e3
    )
    return PoseTrack(
        times_s=torch.rand(count, dtype=torch.float64).cumsum(0) + 1e6, world_from_camera=poses
    )


def test_a_way_comes_back_bit_for_bit() -> None:
    own = track()
    back = read_track(through_text(track_json(own)), "a.json")
    assert torch.equal(back.times_s, own.times_s)
    assert torch.equal(back.world_from_camera, own.world_from_camera)


def full() -> dict:
    optics = Optics(
        lens=LENSES[4],
        aperture=Aperture(radius=0.1, focus_distance=2.0),
        shutter=Shutter(readout_s=0.01),
    )
    return through_text(optics_json(optics))


def put(*keys: str, value: object) -> Callable[[dict], None]:
    def change(own: dict) -> None:
        for key in keys[:-1]:
            own = own[key]
        if value is None:
            del own[keys[-1]]
        else:
            own[keys[-1]] = value

    return change


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (put("lens", value=None), "'lens': expected an object, got nothing"),
        (put("lens", value=[1]), "'lens': expected an object, got a list of 1"),
        (put("lens", "model", value="wide"), "'model': expected one of pinhole, opencv"),
        (put("lens", "model", value="fisheye"), "'coefficients': expected a list of 4 numbers"),
        (put("lens", "coefficients", value=[0, 1, 2, 3]), "expected a list of 5 numbers"),
        (put("lens", "coefficients", value=[0, "1", 2, 3, 4]), "got the text '1'"),
        (put("lens", "coefficients", value=[0, True, 2, 3, 4]), "expected a number, got True"),
        (put("lens", "coefficients", value=[0, math.nan, 2, 3, 4]), "expected a finite number"),
        (put("lens", "coefficients", value=[0, -1, 0, 0, 0]), "expected a positive k_1"),
        (put("lens", "cycles_signs", value="no"), "'cycles_signs': expected true or false"),
        (put("lens", "fov_rad", value=7), "fov_rad: expected an angle"),
        (put("lens", "fov_rad", value=None), "'fov_rad': expected a number, got nothing"),
        (put("aperture", value=0.1), "'aperture': expected an object, got 0.1"),
        (put("aperture", "radius", value=-0.1), "Aperture.radius: expected"),
        (put("aperture", "focus_distance", value=0), "Aperture.focus_distance: expected"),
        (put("aperture", "surface", value="cube"), "'surface': expected one of plane, sphere"),
        (put("shutter", "readout_s", value=-1), "Shutter.readout_s: expected"),
        (put("shutter", "direction", value="up"), "'direction': expected one of top-to-bottom"),
        (put("exposure_s", value=-1e-3), "Optics.exposure_s: expected"),
        (put("exposure_s", value=10**400), "'exposure_s': expected a number"),
        (put("timestamp", value="end"), "'timestamp': expected one of middle, start"),
    ],
)
def test_every_wrong_value_is_named_in_one_line(change, says: str) -> None:
    own = full()
    change(own)
    with pytest.raises(FileFormatError) as caught:
        read_optics(own, "a.json: 'optics'")
    assert says in str(caught.value)
    assert str(caught.value).startswith("a.json: 'optics'")
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (put("times_s", value=[0.0, 1.0]), "expected a list of 3 numbers, got a list of 2"),
        (put("times_s", value=[0.0, 0.0, 1.0]), "expected finite times that increase"),
        (put("world_from_camera", value=[]), "expected a list with entries"),
        (put("world_from_camera", value=[1, 2, 3]), "expected 4 rows, got 1"),
        (put("world_from_camera", value=[[[2, 0, 0, 0]] * 4] * 3), "expected rotations"),
    ],
)
def test_every_wrong_way_is_refused(change, says: str) -> None:
    own = through_text(track_json(track()))
    change(own)
    with pytest.raises(FileFormatError, match=says):
        read_track(own, "a.json")


def test_a_transposed_pose_is_refused() -> None:
    own = through_text(track_json(track()))
    pose = torch.tensor(own["world_from_camera"][1], dtype=torch.float64)
    own["world_from_camera"][1] = pose.mT.tolist()
    with pytest.raises(FileFormatError, match=r"a\.json: 1.*perhaps the matrix is transposed"):
        read_track(own, "a.json")
