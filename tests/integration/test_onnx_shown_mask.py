"""The graph of a motion network that is shown the mask of an object, beside PyTorch."""

import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import torch

from diff4splat.models.config.model import ModelConfig
from diff4splat.models.config.priors import MotionUNetConfig
from diff4splat.models.config.sizes import test_size as tiny_size
from diff4splat.models.factory import create_networks
from diff4splat.models.hub.model import Model, load_model, save_model

EXPORT = """
import sys
from pathlib import Path
from diff4splat.models.hub.model import load_model
from diff4splat.models.onnx_export.folder import ExportSettings, export_model
folder = Path(sys.argv[1])
settings = ExportSettings(parts=("motion_unet",))
(row,) = export_model(load_model(folder / "model"), folder / "onnx", settings)
assert set(row.errors) == {"motion", "mask_logits"}
assert max(row.errors.values()) < 1e-4
"""


def config() -> ModelConfig:
    motion = MotionUNetConfig(width=8, heads=1, object_mask=True)
    return replace(tiny_size(), motion_unet=motion)


def test_motion_is_that_of_the_network_with_a_mask_and_without(tmp_path: Path) -> None:
    networks = create_networks(config())
    for parameter in networks.motion_unet.parameters():
        torch.nn.init.normal_(parameter, std=0.1)
    save_model(Model(config=config(), networks=networks), tmp_path / "model")
    # The exporter cannot trace checks of annotations, which this process has.
    subprocess.run([sys.executable, "-c", EXPORT, str(tmp_path)], check=True)
    graph = load_model(tmp_path / "onnx", parts=("motion_unet",)).networks.motion_unet
    given = (torch.rand(2, 3, 32, 48), torch.randn(2, 3, 2, 8, 12), torch.ones(2))
    text, mask = torch.randn(2, 4, config().text.width), torch.rand(2, 32, 48)
    found = []
    for shown in (mask, None):
        with torch.no_grad():
            found.append(graph(*given, text, None, shown))
            wanted = networks.motion_unet(*given, text, None, shown)
        torch.testing.assert_close(found[-1], wanted, atol=1e-4, rtol=1e-3)
    assert not torch.allclose(*found, atol=1e-3)
