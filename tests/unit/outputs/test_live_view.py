"""The live view of a fit, with a fake in the place of viser."""

import sys
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import ClassVar

import coded_scenes
import numpy as np
import pytest
import torch
from small_fits import ball_capture

from diff4splat.cli.fit import Fit
from diff4splat.errors import ConfigError, MissingExtraError, OutputError
from diff4splat.fitting.fit import fit_scene
from diff4splat.fitting.fit_types import FitRequest
from diff4splat.fitting.settings import FitSettings
from diff4splat.outputs import live_view
from diff4splat.outputs.live_view import LiveView, splat_arrays


class FakeServer:
    """What the view uses of viser, recorded."""

    made: ClassVar["list[FakeServer]"] = []

    def __init__(self, host: str, port: int, verbose: bool) -> None:
        if port == 1:
            raise OSError("permission denied")
        self.host, self.port, self.stopped, self.shown = host, port, False, []
        self.made.append(self)
        self.scene = SimpleNamespace(
            set_up_direction=lambda direction: None, add_gaussian_splats=self._add
        )
        self.gui = SimpleNamespace(add_slider=self._slider)

    def _slider(self, label: str, low: float, high: float, step: float, value: float):
        assert low < high and step > 0
        self.slider = SimpleNamespace(value=value, on_update=self._keep)
        return self.slider

    def _keep(self, callback) -> None:
        self.moved = callback

    def _add(self, name: str, **arrays: np.ndarray):
        self.shown.append(arrays)
        return SimpleNamespace(set_gaussians=lambda **more: self.shown.append(more))

    def on_client_connect(self, callback) -> None:
        self.connected = callback

    def get_port(self) -> int:
        return self.port

    def stop(self) -> None:
        self.stopped = True


@pytest.fixture
def fake(monkeypatch: pytest.MonkeyPatch) -> type[FakeServer]:
    monkeypatch.setitem(sys.modules, "viser", SimpleNamespace(ViserServer=FakeServer))
    monkeypatch.setattr(FakeServer, "made", [])
    return FakeServer


def test_a_scene_is_shown_to_this_machine_alone_and_at_the_sliders_time(fake: type) -> None:
    scene = coded_scenes.scene()
    learned = scene.gaussians.means.clone().requires_grad_()
    scene = replace(scene, gaussians=replace(scene.gaussians, means=learned))
    with LiveView(8123, (0.0, 2.0)) as view:
        (server,) = fake.made
        assert view.address == "http://localhost:8123" and server.host == "127.0.0.1"
        server.moved(None)
        assert not server.shown
        view.offer(lambda: scene)
        view.offer(lambda: pytest.fail("too soon"))
        server.slider.value = 2.0
        server.moved(None)
        first, second = server.shown
        last = scene.state_at(2.0)
        drawn = last.opacities >= live_view.LEAST_OPACITY
        np.testing.assert_allclose(second["centers"], last.means[drawn].detach(), rtol=1e-6)
        assert not np.array_equal(first["centers"], second["centers"])
        client = SimpleNamespace(camera=SimpleNamespace())
        server.connected(client)
        np.testing.assert_allclose(client.camera.position, np.zeros(3))
        assert client.camera.look_at[2] > 1 and client.camera.up_direction[1] == -1
    assert server.stopped


def test_covariances_are_those_of_the_gaussians() -> None:
    gaussians = coded_scenes.scene().gaussians
    arrays = splat_arrays(replace(gaussians, opacities=torch.ones(len(gaussians))))
    spread = np.linalg.eigvalsh(arrays["covariances"])
    want = gaussians.scales.square().sort(-1).values
    np.testing.assert_allclose(spread, want, rtol=1e-2, atol=1e-6)
    assert arrays["rgbs"].min() >= 0 and arrays["rgbs"].max() <= 1
    assert arrays["opacities"].shape == (len(gaussians), 1)


def test_a_fit_offers_its_scene_after_every_step(tmp_path: Path) -> None:
    offered = []
    settings = FitSettings(motion="static", coarse_steps=2, fine_steps=1, harmonics=0, points=20)
    request = FitRequest(
        capture=ball_capture(times=2),
        settings=settings,
        folder=tmp_path,
        backend="reference",
        show=lambda scene: offered.append(len(scene().gaussians)),
    )
    fit_scene(request)
    assert len(offered) == 3 and min(offered) > 0


def test_what_cannot_be_served_is_said_in_a_line(
    fake: type, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    with pytest.raises(OutputError, match="--live: expected a free port, got 1 "):
        LiveView(1, (0.0, 0.0))
    with pytest.raises(ConfigError, match="--live: expected one port, got 2"):
        Fit(data=tmp_path, live=(8080, 8081)).check()
    monkeypatch.setitem(sys.modules, "viser", None)
    with pytest.raises(MissingExtraError, match=r"pip install 'diff4splat\[live\]'"):
        LiveView(8080, (0.0, 1.0))
