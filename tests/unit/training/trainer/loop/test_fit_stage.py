"""Whole runs of a toy stage in one process."""

import json
import math
import os
import signal
from dataclasses import replace
from pathlib import Path

import pytest
import torch
from toy_training import Toy, ToySamples, ToyStage, toy_run, weights

from diff4splat.errors import CheckpointError, ConfigError, DivergenceError, InputError, ShapeError
from diff4splat.progress.phases import Phases
from diff4splat.training.recipe.optimizer import OptimizerSettings
from diff4splat.training.stage import TOTAL
from diff4splat.training.trainer.loading.samples import EVALUATION_START
from diff4splat.training.trainer.loop.fit import fit_stage


def train(folder: Path, toy: Toy | None = None, samples: ToySamples | None = None, **changes):
    """(weights, result) of a call with a stage made afresh."""
    stage = changes.pop("stage", None) or ToyStage()
    run = toy_run(folder, **changes)
    result = fit_stage(stage, samples or ToySamples(), (toy or Toy()).recipe(), run)
    return weights(stage), result


def rows(folder: Path, event: str) -> list[dict]:
    found = [json.loads(line) for line in (folder / "log.jsonl").read_text().splitlines()]
    return [row for row in found if row["event"] == event]


def assert_same(first: dict, second: dict, tolerance: float = 0.0) -> None:
    torch.testing.assert_close(first, second, rtol=tolerance, atol=tolerance)


def test_only_trained_parts_change_and_the_loss_falls(tmp_path) -> None:
    before = weights(ToyStage())
    after, result = train(tmp_path, Toy(steps=200))
    changed = {key.split(".")[0] for key in before if not torch.equal(before[key], after[key])}
    assert changed == {"body", "head"}
    losses = [row["loss/total"] for row in rows(tmp_path, "step")]
    assert sum(losses[-20:]) < 0.7 * sum(losses[:20])
    assert (result.outcome, result.step) == ("finished", 200)
    assert result.checkpoint.is_dir()


@pytest.mark.parametrize("parallel", ["none", "ddp", "fsdp2"])
@pytest.mark.parametrize("precision", ["float32", "bfloat16"])
def test_chunks_of_any_length_give_the_run_without_a_stop(tmp_path, parallel, precision) -> None:
    settings = {"parallel": parallel, "precision": precision, "checkpoint_every": 2}
    whole, result = train(tmp_path / "whole", **settings)
    outcomes = []
    while "finished" not in outcomes:
        # The stage of a new process has forgotten everything, its initial weights included.
        parts, last = train(
            tmp_path / "parts", stage=ToyStage(), stop_after_steps=1 + len(outcomes), **settings
        )
        outcomes.append(last.outcome)
    assert outcomes == ["step_limit", "step_limit", "finished"]
    assert_same(whole, parts)
    assert last.measures == result.measures
    again, same = train(tmp_path / "parts", stage=ToyStage(), **settings)
    assert_same(whole, again)
    assert same == last


@pytest.mark.parametrize("parallel", ["ddp", "fsdp2"])
def test_wrappers_change_nothing_alone(tmp_path, parallel) -> None:
    plain, _ = train(tmp_path / "none")
    wrapped, _ = train(tmp_path / "wrapped", parallel=parallel)
    assert_same(plain, wrapped, 1e-6)


def test_accumulation_equals_one_big_batch(tmp_path) -> None:
    big, _ = train(tmp_path / "big", Toy(micro_batch=4))
    small, _ = train(tmp_path / "small", Toy(micro_batch=1))
    assert_same(big, small, 1e-6)
    one, other = (rows(tmp_path / name, "step") for name in ("big", "small"))
    for name in ("loss/total", "gradient_norm"):  # Adam and clipping hide a wrong scale
        assert one[0][name] == pytest.approx(other[0][name], rel=1e-5)


def test_first_steps_follow_adam_by_hand(tmp_path) -> None:
    stage = ToyStage()
    samples, own = ToySamples(), OptimizerSettings(learning_rate=0.1, clip_norm=1e9, warmup_steps=1)
    frozen = stage.head.weight.detach().double().clone()
    batch = samples.collate([samples[index] for index in range(4)])
    stage.eval()
    loss = stage(batch)[TOTAL].mean()
    (gradient,) = torch.autograd.grad(loss, stage.head.weight)
    after, _ = train(tmp_path, Toy(steps=1, micro_batch=4, optimizer=own), stage=stage)
    gradient = gradient.double()
    expected = frozen * (1 - 0.1 * 1e-4) - 0.1 * gradient / (gradient.abs() + 1e-8)
    torch.testing.assert_close(after["head.weight"].double(), expected, rtol=1e-5, atol=1e-6)
    (row,) = rows(tmp_path, "step")
    assert row["loss/total"] == pytest.approx(loss.item(), rel=1e-6)
    assert row["learning_rate"] == pytest.approx(0.1)
    assert row["samples_per_s"] > 0
    assert 0 <= row["waiting_share"] <= 1
    assert {"source/even", "source/odd", "loss/second", "gradient_norm"} <= set(row)


def test_bfloat16_keeps_float32_weights(tmp_path) -> None:
    exact, _ = train(tmp_path / "exact")
    half, _ = train(tmp_path / "half", precision="bfloat16")
    assert {value.dtype for value in half.values()} == {torch.float32}
    assert not torch.equal(exact["head.weight"], half["head.weight"])
    assert_same(exact, half, 0.05)


def test_half_master_weights_are_refused(tmp_path) -> None:
    with pytest.raises(ShapeError, match="expected float32 master weights"):
        train(tmp_path, stage=ToyStage().to(torch.bfloat16))


def test_a_step_that_is_not_finite_changes_nothing_but_the_clock(tmp_path) -> None:
    train(tmp_path, samples=ToySamples(nan_at=frozenset({9})), stop_after_steps=2)
    before, _ = train(tmp_path / "copy", samples=ToySamples(), stop_after_steps=2)
    after, _ = train(tmp_path, samples=ToySamples(nan_at=frozenset({9})), stop_after_steps=1)
    assert_same(before, after)
    (skip,) = rows(tmp_path, "skip")
    assert (skip["step"], skip["bad_samples"], skip["samples"]) == (2, [9], [8, 9, 10, 11])
    snapshot = json.loads((tmp_path / "skipped.json").read_text())
    assert snapshot["skipped_steps"][0]["bad_samples"] == [9]
    _, result = train(tmp_path, samples=ToySamples(nan_at=frozenset({9})))
    state = json.loads((result.checkpoint / "state.json").read_text())["progress"]
    assert state["skips"] == {"loss is not finite": 1}
    assert state["average_updates"] == {"body": 5, "head": 5}
    assert result.step == 6
    assert rows(tmp_path, "step")[2]["loss/total"] is None


def test_a_run_that_never_is_finite_gives_up(tmp_path) -> None:
    broken = ToySamples(nan_at=frozenset(range(1000)))
    with pytest.raises(DivergenceError, match="3 in a row"):
        train(tmp_path, samples=broken, most_skips_in_a_row=3)
    assert len(json.loads((tmp_path / "skipped.json").read_text())["skipped_steps"]) == 3


def test_spikes_in_a_row_go_back_and_leave_their_data_out(tmp_path) -> None:
    toy = Toy(steps=40, micro_batch=4)
    far = ToySamples(far_at=frozenset(range(4 * 31, 4 * 34)))
    settings = {
        "checkpoint_every": 10,
        "spikes_before_rollback": 3,
        "spike_factor": 50.0,
        "outlier_factor": 0.0,
    }
    whole, result = train(tmp_path / "whole", toy, far, **settings)
    (back,) = rows(tmp_path / "whole", "rollback")
    assert (back["step"], back["from_step"]) == (30, 33)
    assert len(rows(tmp_path / "whole", "spike")) == 3
    progress = json.loads((result.checkpoint / "state.json").read_text())["progress"]
    assert progress["first_sample"] == 4 * (34 - 30)
    assert (progress["rollbacks"], progress["spikes"], result.step) == (1, 3, 40)
    assert result.checkpoint.name == "window-001-step-00000040"

    class Elsewhere(ToySamples):
        """What the run saw in the end: steps 30 and on took samples from 34·4 on."""

        def __getitem__(self, sample_index: int):
            return super().__getitem__(sample_index + (16 if 120 <= sample_index < 2**40 else 0))

    calm, _ = train(tmp_path / "calm", toy, Elsewhere(), **settings)
    assert_same(calm, whole)
    for _ in range(math.ceil(44 / 8)):
        parts, last = train(tmp_path / "parts", toy, far, stop_after_steps=8, **settings)
    assert last.outcome == "finished"
    assert_same(whole, parts)


def test_spikes_without_a_checkpoint_are_only_noted(tmp_path) -> None:
    notes: list[str] = []
    far = ToySamples(far_at=frozenset(range(4 * 21, 4 * 25)))
    _, result = train(
        tmp_path,
        Toy(steps=26, micro_batch=4),
        far,
        checkpoint_every=100,
        spike_factor=50.0,
        note=notes.append,
    )
    assert result.outcome == "finished"
    assert any("no checkpoint to go back to" in text for text in notes)


def test_spikes_that_come_back_end_the_run(tmp_path) -> None:
    far = ToySamples(far_at=frozenset(range(4 * 31, 4000)))
    with pytest.raises(DivergenceError, match="steady loss after step 30"):
        train(tmp_path, Toy(steps=60, micro_batch=4), far, checkpoint_every=10, spike_factor=50.0)


def test_bad_samples_are_counted_and_a_broken_source_ends_the_run(tmp_path) -> None:
    _, result = train(tmp_path, samples=ToySamples(unusable=frozenset({3, 7})))
    progress = json.loads((result.checkpoint / "state.json").read_text())["progress"]
    assert progress["replaced"] == {"InputError: expected some depth": 2}
    assert [row["sample"] for row in rows(tmp_path, "replaced_sample")] == [3, 7]
    with pytest.raises(InputError, match="check the data source"):
        train(tmp_path / "broken", samples=ToySamples(all_unusable=True))


def test_our_errors_inside_the_stage_are_not_swallowed(tmp_path) -> None:
    class Refusing(ToyStage):
        def forward(self, batch):
            raise ShapeError("depth: expected h w, got h")

    with pytest.raises(ShapeError, match="expected h w"):
        train(tmp_path, stage=Refusing())


def test_evaluation_uses_averages_and_samples_of_its_own(tmp_path) -> None:
    seen: list[int] = []

    class Watching(ToyStage):
        def measure(self, batch):
            seen.extend(batch.sample_index.tolist())
            assert not self.training and not self.body.training and not torch.is_grad_enabled()
            found = super().measure(batch)
            self.measured = weights(self)
            return found

    stage = Watching()
    after, result = train(tmp_path, stage=stage, evaluate_every=4)
    assert seen == [EVALUATION_START + i for i in (0, 1, 2)] * 2
    assert not torch.equal(stage.measured["head.weight"], after["head.weight"])
    found = rows(tmp_path, "evaluation")
    assert [row["step"] for row in found] == [4, 6]
    assert result.measures == {"psnr": found[-1]["psnr"]}
    assert json.loads((tmp_path / "result.json").read_text())["measures"] == result.measures
    panels = sorted(path.name for path in (tmp_path / "panels").iterdir())
    assert panels == ["step-00000004.png", "step-00000006.png"]


def test_frozen_parts_never_train_and_dropout_inside_them_sleeps(tmp_path) -> None:
    class Strict(ToyStage):
        def forward(self, batch):
            assert self.body.training and self.head.training
            assert not self.eyes.training and not self.unused.training
            assert not any(p.requires_grad for p in self.eyes.parameters())
            return super().forward(batch)

    train(tmp_path, stage=Strict())


def test_a_signal_saves_and_the_rest_follows_later(tmp_path) -> None:
    whole, _ = train(tmp_path / "whole")

    class Signalling(ToySamples):
        def __getitem__(self, sample_index: int):
            if sample_index == 9:
                os.kill(os.getpid(), signal.SIGTERM)
            return super().__getitem__(sample_index)

    before = signal.getsignal(signal.SIGTERM)
    _, result = train(tmp_path / "parts", samples=Signalling())
    assert (result.outcome, result.step) == ("signalled", 3)
    assert signal.getsignal(signal.SIGTERM) is before
    rest, result = train(tmp_path / "parts")
    assert result.outcome == "finished"
    assert_same(whole, rest)


def test_a_second_signal_does_what_it_always_did(tmp_path) -> None:
    class Impatient(ToySamples):
        def __getitem__(self, sample_index: int):
            if sample_index == 5:
                os.kill(os.getpid(), signal.SIGINT)
                os.kill(os.getpid(), signal.SIGINT)
            return super().__getitem__(sample_index)

    with pytest.raises(KeyboardInterrupt):
        train(tmp_path, samples=Impatient())


def test_time_is_up_after_the_step(tmp_path) -> None:
    _, result = train(tmp_path, stop_after_s=0.0)
    assert (result.outcome, result.step) == ("time_limit", 1)
    assert not json.loads((tmp_path / "result.json").read_text())["finished"]


def test_the_next_stage_takes_over_weights_and_averages(tmp_path) -> None:
    first, _ = train(tmp_path / "one")

    class Next(ToyStage):
        trained = ("body", "unused")

        def predict(self, batch):
            return self.unused(super().predict(batch))

    stage = Next(seed=1)
    fresh = weights(stage)
    after, second = train(
        tmp_path / "two",
        Toy(name="next"),
        stage=stage,
        start_from=tmp_path / "one",
        stop_after_steps=1,
    )
    progress = json.loads((second.checkpoint / "state.json").read_text())["progress"]
    assert (progress["step"], progress["first_sample"]) == (1, 0)
    assert progress["average_updates"] == {"body": 7, "unused": 1}
    assert not torch.equal(after["head.weight"], first["head.weight"])  # frozen now: averaged
    assert torch.equal(after["eyes.0.weight"], fresh["eyes.0.weight"])  # in no checkpoint
    assert (after["body.stem.weight"] - first["body.stem.weight"]).abs().max() < 0.02
    resumed, _ = train(
        tmp_path / "two", Toy(name="next"), stage=Next(seed=1), start_from=tmp_path / "one"
    )
    assert torch.equal(resumed["head.weight"], after["head.weight"])


def test_a_stage_that_is_not_over_is_not_taken_over(tmp_path) -> None:
    train(tmp_path / "one", stop_after_steps=2)
    with pytest.raises(CheckpointError, match="of a finished stage, got step 2"):
        train(tmp_path / "two", start_from=tmp_path / "one")
    with pytest.raises(CheckpointError, match="got no checkpoint"):
        train(tmp_path / "two", start_from=tmp_path / "nothing")


def test_frozen_parts_are_stored_when_asked(tmp_path) -> None:
    stage = ToyStage(seed=3)
    train(tmp_path / "one", stage=stage, store_frozen=True)
    second = ToyStage()
    train(tmp_path / "two", stage=second, start_from=tmp_path / "one", stop_after_steps=1)
    assert torch.equal(second.eyes[0].weight, stage.eyes[0].weight)


def test_progress_is_reported_in_steps(tmp_path) -> None:
    class Counting(Phases):
        def __init__(self) -> None:
            super().__init__()
            self.done: list[tuple[str, int]] = []

        def bar(self, name: str, steps: int):
            self.done.append((name, steps))
            return super().bar(name, steps)

    phases = Counting()
    train(tmp_path, phases=phases, stop_after_steps=2)
    train(tmp_path, phases=phases)
    assert phases.done == [("toy", 6), ("toy", 4)]


def test_every_tenth_step_is_logged_when_asked(tmp_path) -> None:
    train(tmp_path, log_every=3)
    assert [row["step"] for row in rows(tmp_path, "step")] == [0, 3]


def test_half_a_row_of_a_killed_run_does_not_swallow_the_next(tmp_path) -> None:
    train(tmp_path, stop_after_steps=2)
    with (tmp_path / "log.jsonl").open("a") as file:
        file.write('{"event": "st')
    train(tmp_path)
    lines = (tmp_path / "log.jsonl").read_text().splitlines()
    assert lines.count('{"event": "st') == 1
    assert json.loads(lines[-1])


def test_curves_are_written_where_tensorboard_is_installed(tmp_path) -> None:
    pytest.importorskip("tensorboard")
    train(tmp_path)
    (file,) = (tmp_path / "tensorboard").iterdir()
    assert file.stat().st_size > 500


def test_without_tensorboard_one_line_says_so(tmp_path, monkeypatch) -> None:
    monkeypatch.setitem(__import__("sys").modules, "torch.utils.tensorboard", None)
    notes: list[str] = []
    train(tmp_path, note=notes.append)
    assert sum("tensorboard is not installed" in text for text in notes) == 1
    assert not (tmp_path / "tensorboard").exists()


@pytest.mark.parametrize(
    "changes",
    [{"stop_after_steps": -1}, {"log_every": 0}, {"stop_after_s": -1.0}, {"timeout_s": 0.0}],
)
def test_limits_out_of_range_are_refused(tmp_path, changes: dict) -> None:
    with pytest.raises(ConfigError, match="above 0"):
        toy_run(tmp_path, **changes)


def test_a_part_that_does_not_exist_is_refused(tmp_path) -> None:
    stage = ToyStage()
    stage.trained = ("body", "tail")
    with pytest.raises(ConfigError, match=r"\(eyes, body, head, unused\), got tail"):
        train(tmp_path, stage=stage)


def test_one_process_settings_under_a_launcher_are_refused(tmp_path, monkeypatch) -> None:
    monkeypatch.setenv("WORLD_SIZE", "2")
    with pytest.raises(ConfigError, match="expected ddp or fsdp2 for 2 processes"):
        train(tmp_path)


def test_measures_that_are_not_finite_come_back_as_nan(tmp_path) -> None:
    class Undefined(ToyStage):
        def measure(self, batch):
            return {"psnr": torch.full((1,), torch.nan)}

    _, result = train(tmp_path, stage=Undefined())
    assert math.isnan(result.measures["psnr"])
    assert replace(result, measures={}).outcome == "finished"
