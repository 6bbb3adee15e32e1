"""The graph of LDRM has the distances at which key frames start among its inputs."""

from dataclasses import replace

import torch
from oracles_models import randomised

from diff4splat.models.config.model import MonocularDepthConfig, RefinementConfig
from diff4splat.models.config.sizes import test_size as tiny_size
from diff4splat.models.ldrm.ldrm import Ldrm
from diff4splat.models.ldrm.refinement.posed_video import PosedVideo, StartDistance
from diff4splat.models.onnx.adapters import posed_inputs
from diff4splat.models.onnx_export.gaussian_graphs import ldrm_graphs, posed_video

REFINEMENT = RefinementConfig(
    channels=6, match_channels=4, cost_volume_depths=4, border_cells=4, depth_prior=True
)
CONFIG = replace(
    tiny_size(), refinement=REFINEMENT, monocular_depth=MonocularDepthConfig(channels=8)
)


def test_the_graph_takes_where_key_frames_start_and_gives_the_maps_of_the_network() -> None:
    network = randomised(Ldrm(CONFIG))
    graph, _ = ldrm_graphs(network, CONFIG)
    names = [source.spec.name for source in graph.inputs]
    latent, camera, *video = given = graph.examples(graph.traced_sizes())
    start = StartDistance(**dict(zip(names[-3:], given[-3:], strict=True)))
    posed: PosedVideo = replace(posed_video(*video[:4]), start=start)
    wanted = network(latent, camera, posed, moving=False)
    found = graph.module(*given)
    torch.testing.assert_close(found[0], wanted.gaussians)
    named = posed_inputs(posed)
    assert all(torch.equal(named[name], given[names.index(name)]) for name in names[2:])


def test_a_model_without_a_depth_prior_has_no_such_inputs() -> None:
    plain = replace(CONFIG, refinement=replace(REFINEMENT, depth_prior=False))
    graph, _ = ldrm_graphs(Ldrm(plain), plain)
    assert not {"prior", "parallax", "confidence"} & {one.spec.name for one in graph.inputs}
