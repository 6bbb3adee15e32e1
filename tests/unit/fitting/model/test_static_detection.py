"""Who moves is found from images; who proved still leaves the motion."""

from dataclasses import replace

import pytest
import torch
from small_fits import ball_capture, balls

from diff4splat.fitting.frames.frame_renderer import FrameRenderer
from diff4splat.fitting.frames.frame_schedule import FrameSchedule
from diff4splat.fitting.frames.frame_store import FrameStore
from diff4splat.fitting.model.canonical import params_from_gaussians
from diff4splat.fitting.model.prune_static import pixel_footprint, prune_static
from diff4splat.fitting.model.scene_model import SceneModel
from diff4splat.fitting.model.static_detection import confirm_static, error_variation
from diff4splat.fitting.motions.spacetime import SpacetimeGaussians
from diff4splat.fitting.settings import FitSettings
from diff4splat.scene.gaussians import Gaussians

CAPTURE = ball_capture(views=4, times=3, held=())


def test_the_ball_that_moves_varies_most_and_what_it_never_covers_hardly():
    still = balls(0.0).to(torch.float32)
    varies = error_variation(
        still, FrameRenderer(capture=CAPTURE), FrameStore(CAPTURE), FrameSchedule(CAPTURE, 2, 0)
    )
    assert int(varies.argmax()) == 0
    assert float(varies[0]) > 0.1
    assert float(varies[1:].amin()) < 0.02


def test_what_no_image_shows_does_not_vary():
    away = replace(balls(0.0), means=balls(0.0).means + 100).to(torch.float32)
    varies = error_variation(
        away, FrameRenderer(capture=CAPTURE), FrameStore(CAPTURE), FrameSchedule(CAPTURE, 2, 0)
    )
    assert not varies.any()


@pytest.mark.parametrize(("shift", "color", "expected"), [(0.0, 0.0, True), (1.0, 0.0, False),
                                                          (0.0, 1.0, False)])  # fmt: skip
def test_proved_still_looks_at_place_and_looks(shift: float, color: float, expected: bool):
    base = balls(0.5).to(torch.float32)

    def state_at(time_s: float) -> Gaussians:
        return replace(base, means=base.means + shift * time_s, sh=base.sh + color * time_s)

    still, middle = confirm_static(state_at, (0.0, 0.5, 1.0), (0.1, 0.1))
    assert bool(still.all()) is expected and bool(still.any()) is expected
    torch.testing.assert_close(middle.means, base.means + 0.5 * shift)


def test_a_limit_may_differ_between_gaussians():
    base = balls(0.5).to(torch.float32)
    reach = torch.tensor([1.0, 0.01, 1.0, 0.01, 1.0])
    still, _ = confirm_static(
        lambda time_s: replace(base, means=base.means + 0.2 * time_s), (0.0, 1.0), (reach, 0.1)
    )
    assert still.tolist() == [True, False, True, False, True]


def test_a_pixel_covers_more_further_away():
    points = torch.tensor([[0.0, 0.0, 0.0], [0.0, 0.0, 20.0]])
    near, far = pixel_footprint(CAPTURE, points).tolist()
    assert near == pytest.approx(2.43 / 26.4, rel=0.02)
    assert far > 5 * near


def test_standing_pulses_are_taken_out_with_the_state_that_was_seen():
    rows = params_from_gaussians(balls(0.5).to(torch.float32), 1)
    model = SceneModel(rows, SpacetimeGaussians((0.0, 1.0), 0.05), torch.ones(5, dtype=torch.bool))
    with torch.no_grad():
        model.table["velocities"][2] = 3.0
    before = model.state_at(0.25, 1)
    taken = prune_static(model, CAPTURE, FitSettings(motion="spacetime"), 1)
    assert model.moving_mask.tolist() == [False, False, True, False, False]
    assert "4 of 5" in taken.why and taken.saved.startswith("80%")
    after = model.state_at(0.25, 1)
    # A pulse of ten time ranges is not quite 1 everywhere.
    torch.testing.assert_close(after.opacities, before.opacities, atol=2e-3, rtol=0)
    torch.testing.assert_close(after.means, before.means, atol=1e-6, rtol=1e-6)
    model.moving_mask[:] = False
    assert prune_static(model, CAPTURE, FitSettings(motion="spacetime"), 1) is None
