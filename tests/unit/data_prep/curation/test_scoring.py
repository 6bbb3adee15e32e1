"""Scores of clips whose faults are known, and decisions by thresholds."""

from dataclasses import replace

import numpy as np
import pytest
import torch
from textured_clips import textured_clip, without_depth

from diff4splat.data.checks import require_valid_clip
from diff4splat.data.clip import Clip, Flow
from diff4splat.data_prep.curation.clip_record import ClipRecord, record_of
from diff4splat.data_prep.curation.completion import completed
from diff4splat.data_prep.curation.decisions import decide
from diff4splat.data_prep.curation.duplicates.hashes import duplicates_of
from diff4splat.data_prep.curation.scoring import STAGES, score_clip
from diff4splat.data_prep.curation.stages.dynamic_mask import estimated_moving
from diff4splat.data_prep.curation.stages.fingerprints import perceptual_hash
from diff4splat.data_prep.curation.stages.geometry import induced_flow
from diff4splat.data_prep.curation.stages.image_motion import score_image_motion
from diff4splat.data_prep.curation.thresholds import read_thresholds
from diff4splat.data_prep.curation.tracks.filtering import (
    moving_tracks,
    reliable_tracks,
    without_tracks,
)
from diff4splat.data_prep.curation.tracks.flow_chains import with_chained_tracks
from diff4splat.data_prep.curation.working_clip import reduced_map, working_clip
from diff4splat.errors import ConfigError

FRAMES = 9


@pytest.fixture(scope="module")
def static() -> Clip:
    return textured_clip(FRAMES)


@pytest.fixture(scope="module")
def dynamic() -> Clip:
    return textured_clip(FRAMES, moving=True)


def scored(clip: Clip) -> ClipRecord:
    return score_clip(clip, record_of(clip, "folder", "0"))


def with_rgb(clip: Clip, rgb: np.ndarray) -> Clip:
    return replace(clip, views=(replace(clip.views[0], rgb=torch.from_numpy(rgb)),))


def as_real(clip: Clip) -> Clip:
    return replace(clip, note=replace(clip.note, metric="aligned"))


def first_reason(clip: Clip) -> str:
    decision = decide([scored(clip)], read_thresholds(None))[0]
    return decision.reasons[0].text if decision.reasons else ""


def test_there_are_twelve_stages_and_a_good_clip_passes(static) -> None:
    assert len(STAGES) == 12
    record = scored(static)
    assert record.message == ""
    assert first_reason(static) == ""
    assert record.scores["reprojection_error"] < 1e-4
    assert record.scores["reprojection_px"] < 0.3
    assert record.scores["path_over_depth"] == pytest.approx(0.07, abs=0.04)
    assert record.labels["motion"] == "static"


def test_every_fault_has_its_reason(static) -> None:
    rgb = static.views[0].rgb.numpy()
    cut = np.concatenate([rgb[:5], 255 - rgb[5:]])
    repeated = rgb[[0, 0, 0, 1, 1, 1, 2, 2, 3]]
    dark = (rgb * 0.05).astype(np.uint8)
    bordered = rgb.copy()
    bordered[:, :14], bordered[:, -14:] = 0, 0
    frozen = rgb[[0] * FRAMES]
    faults = {
        "cut inside the clip": with_rgb(static, cut),
        "repeated frames": with_rgb(static, repeated),
        "too dark or too bright": with_rgb(static, dark),
        "black borders": with_rgb(static, bordered),
        "frozen": with_rgb(static, frozen),
    }
    for reason, clip in faults.items():
        decision = decide([scored(as_real(clip))], read_thresholds(None))[0]
        assert reason in [each.text for each in decision.reasons]


def test_text_over_a_moving_image_is_noticed(static) -> None:
    rgb = static.views[0].rgb.numpy().copy()
    plain = scored(as_real(static)).scores["overlay_share"]
    stripes = (np.arange(128) // 3 % 2 * 255).astype(np.uint8)
    rgb[:, 70:92] = stripes[None, None, :, None]
    assert plain < 0.02
    assert scored(as_real(with_rgb(static, rgb))).scores["overlay_share"] > 0.15


def test_wrong_poses_are_found_by_geometry(static) -> None:
    pose = static.views[0].cameras.world_from_camera.clone()
    pose[:, 0, 3] *= -2
    cameras = static.views[0].cameras.with_pose(pose)
    wrong = replace(static, views=(replace(static.views[0], cameras=cameras),))
    assert first_reason(wrong) in ("depth and cameras disagree", "flow and cameras disagree")


def test_jumps_of_the_camera_do_not_depend_on_its_unit(static) -> None:
    pose = static.views[0].cameras.world_from_camera.clone()
    pose[5, 1, 3] += 1.5
    for unit in (1.0, 1000.0):
        moved = pose.clone()
        moved[:, :3, 3] *= unit
        view = static.views[0]
        view = replace(view, cameras=view.cameras.with_pose(moved), depth=view.depth * unit)
        record = scored(as_real(replace(static, views=(view,))))
        assert record.scores["acceleration_residual"] == pytest.approx(0.66, abs=0.05)


@pytest.mark.parametrize("has_depth", [True, False])
def test_the_estimated_mask_finds_what_moves(dynamic, has_depth) -> None:
    blind = replace(dynamic, views=(replace(dynamic.views[0], moving=None),))
    blind = blind if has_depth else without_depth(blind)
    working = score_image_motion(working_clip(blind, record_of(blind, "", "")))
    found = estimated_moving(working)
    true = reduced_map(dynamic.views[0].moving.numpy(), working.size_px)
    overlap = (found & true).sum() / (found | true).sum()
    assert overlap > (0.6 if has_depth else 0.4)


def test_a_damaged_clip_is_a_row_with_its_stage_and_error(static) -> None:
    depth = static.views[0].depth.clone()
    depth[0, 0, 0] = torch.nan
    damaged = replace(static, views=(replace(static.views[0], depth=depth),))
    record = scored(damaged)
    assert (record.stage, record.error) == ("integrity", "InputError")
    decision = decide([record], read_thresholds(None))[0]
    assert not decision.is_selected
    assert "finite depth" in decision.reasons[0].detail


def with_true_flow(clip: Clip) -> Clip:
    view = clip.views[0]
    flow = np.stack([induced_flow(view.cameras, n, view.depth[n]) for n in range(clip.frames - 1)])
    known = torch.ones(flow.shape[:-1], dtype=torch.bool)
    stored = Flow(to_next=torch.from_numpy(flow).float(), known=known, visible=known)
    return replace(clip, views=(replace(view, flow=stored),))


def test_chains_of_flow_are_static_points_of_a_static_scene(static) -> None:
    tracked = with_chained_tracks(with_true_flow(static), most=400)
    assert tracked.note.track_source == "chained"
    assert tracked.tracks.positions.shape[1] > 150
    assert not moving_tracks(tracked).any()
    assert reliable_tracks(tracked).float().mean() > 0.9
    record = scored(tracked)
    assert record.message == ""
    assert record.scores["tracks_reliable"] > 150
    assert record.scores["tracks_moving"] == 0


def test_tracks_that_jump_or_leave_their_surface_are_not_reliable(static) -> None:
    tracked = with_chained_tracks(with_true_flow(static), most=400)
    good = reliable_tracks(tracked).nonzero()[:2, 0]
    uv = tracked.views[0].track_uv.clone()
    uv[4, good[0]] += 60.0
    positions = tracked.tracks.positions.clone()
    positions[:, good[1]] *= 1.3
    damaged = replace(
        tracked,
        tracks=replace(tracked.tracks, positions=positions),
        views=(replace(tracked.views[0], track_uv=uv),),
    )
    assert not reliable_tracks(damaged)[good].any()
    kept = without_tracks(damaged, reliable_tracks(damaged))
    assert kept.tracks.positions.shape[1] == int(reliable_tracks(damaged).sum())


def test_completion_adds_masks_and_tracks_and_changes_nothing_exact(static, dynamic) -> None:
    blind = replace(dynamic, views=(replace(dynamic.views[0], moving=None),))
    found, true = completed(blind).views[0].moving, dynamic.views[0].moving
    assert (found & true).sum() > 0.6 * (found | true).sum()
    tracked = completed(with_true_flow(static))
    assert tracked.note.track_source == "chained"
    require_valid_clip(tracked)
    exact = replace(tracked, note=replace(tracked.note, track_source="exact"))
    assert completed(exact) is exact


def record(name: str, quality: int = 1, **labels: str) -> ClipRecord:
    scores = {"quality": float(quality)}
    return ClipRecord(identifier=name, dataset="set", scores=scores, labels=labels)


def test_the_best_of_several_alike_remains(static, dynamic) -> None:
    first = perceptual_hash(static.views[0].rgb[0].numpy())
    other = perceptual_hash(dynamic.views[0].rgb[-1].numpy())
    records = [
        record("worse", 1, hash=f"{first ^ 5:016x}"),
        record("better", 2, hash=f"{first:016x}"),
        record("other", 1, hash=f"{~other & (2**64 - 1):016x}"),
    ]
    found = list(duplicates_of([records[1], records[0], records[2]], 3))
    assert [(a.identifier, b.identifier) for a, b in found] == [("worse", "better")]


def test_bands_find_every_pair_that_a_full_comparison_finds() -> None:
    rng = np.random.default_rng(0)
    base = [int(v) for v in rng.integers(0, 2**63, 40)]
    flips = [b ^ sum(1 << int(p) for p in rng.choice(64, rng.integers(0, 8), False)) for b in base]
    ranked = [record(str(n), hash=f"{v:016x}") for n, v in enumerate([*base, *flips])]
    found = {a.identifier for a, _ in duplicates_of(ranked, 3)}
    values = [*base, *flips]
    expected = {
        str(40 + n)
        for n in range(40)
        if any((values[40 + n] ^ values[m]).bit_count() <= 3 for m in range(40))
    }
    assert found == expected


def test_quotas_and_groups_keep_the_best() -> None:
    thresholds = replace(
        read_thresholds(None), gates=(), per_group=2, quotas={"motion": {"static": 1}}
    )
    records = [
        record("a", 3, group="g", motion="static"),
        record("b", 2, group="g", motion="static"),
        record("c", 1, group="g", motion="fast"),
    ]
    decisions = {d.record.identifier: d for d in decide(records, thresholds)}
    assert decisions["a"].is_selected
    assert decisions["b"].reasons[0].stage == "balance"
    assert decisions["c"].reasons[0].text == "enough clips of this scene"


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("version = 2", "version: expected 1"),
        ("version = 1\nodd = 1", "got 'odd'"),
        ("version = ", "expected TOML"),
        ('version = 1\n[[gate]]\nstage = "x"\nscore = "y"\nreason = "z"', "gate 1, stage"),
        (
            'version = 1\n[[gate]]\nstage = "depth"\nscore = "y"\nreason = "z"\nleast = true',
            "least",
        ),
        ("version = 1\n[quotas.motion]\nstatic = -1", "quotas.motion.static"),
        ("version = 1\ngate = 3", "expected tables"),
    ],
)
def test_wrong_thresholds_say_what_is_wrong(tmp_path, text, message) -> None:
    file = tmp_path / "t.toml"
    file.write_text(text)
    with pytest.raises(ConfigError, match=message):
        read_thresholds(file)
