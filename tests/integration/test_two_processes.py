"""Two real processes over Gloo: they agree, they resume, and one may die."""

import json
import os
import signal
import socket
import subprocess
import sys
from pathlib import Path

import pytest
import torch
from toy_training import Toy, ToySamples, ToyStage, toy_run, weights

from diff4splat.training.trainer.checkpoints.export import load_parts
from diff4splat.training.trainer.loop.fit import fit_stage

SUPPORT = Path(__file__).parents[1] / "support"
MODES = ("ddp", "fsdp2")
SHARED = {"checkpoint_every": 2, "timeout_s": 120.0}


def launch(folder: Path, calls: list[dict]) -> list[int]:
    """Exit codes of two processes that make the calls, started as ``torchrun`` does."""
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = str(free.getsockname()[1])
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "calls.json").write_text(json.dumps(calls))
    shared = os.environ | {"WORLD_SIZE": "2", "MASTER_ADDR": "127.0.0.1", "MASTER_PORT": port}
    shared |= {"OMP_NUM_THREADS": "1"}
    command = [sys.executable, str(SUPPORT / "toy_process.py"), str(folder / "calls.json")]
    with (folder / "errors.txt").open("w") as errors:
        running = [
            subprocess.Popen(
                command, env=shared | {"RANK": str(rank), "LOCAL_RANK": str(rank)}, stderr=errors
            )
            for rank in range(2)
        ]
        try:
            return [process.wait(timeout=400) for process in running]
        finally:
            for process in running:
                process.kill()


def asked(folder: Path, **more: object) -> dict:
    run = {**SHARED, **more.pop("run", {})}
    return {"folder": str(folder), "run": run, **more}


def alone(folder: Path, samples: ToySamples | None = None, **changes: object) -> dict:
    """Weights of the same run in this process."""
    stage = ToyStage()
    changes = {"checkpoint_every": 2} | changes
    fit_stage(stage, samples or ToySamples(), Toy().recipe(), toy_run(folder, **changes))
    return weights(stage)


def result(folder: Path, rank: int = 0) -> dict:
    return torch.load(folder / f"rank-{rank}.pt", weights_only=True)


def tensors(found: dict) -> dict:
    return {key: value for key, value in found.items() if isinstance(value, torch.Tensor)}


def rows(folder: Path, event: str) -> list[dict]:
    found = [json.loads(line) for line in (folder / "log.jsonl").read_text().splitlines()]
    return [row for row in found if row["event"] == event]


def latest(folder: Path) -> Path:
    return folder / "checkpoints" / (folder / "checkpoints" / "latest").read_text().strip()


def state(folder: Path) -> dict:
    return json.loads((latest(folder) / "state.json").read_text())


@pytest.fixture(scope="module")
def done(tmp_path_factory) -> Path:
    """Folder of everything that two living processes can do, in one launch."""
    root = tmp_path_factory.mktemp("two")
    alone(root / "from-one", stop_after_steps=3)
    calls = []
    for mode in MODES:
        own = {"parallel": mode}
        calls += [
            asked(root / mode / "whole", run=own),
            asked(root / mode / "parts", run=own | {"stop_after_steps": 3}),
            asked(root / mode / "to-one", run=own | {"stop_after_steps": 3}),
            asked(root / mode / "parts", run=own),
            asked(root / mode / "nan", run=own, nan_at=[11], unusable=[2, 7]),
            asked(root / mode / "small", run=own, toy={"micro_batch": 1}),
            asked(root / mode / "half", run=own | {"precision": "bfloat16"}),
        ]
    calls.append(asked(root / "from-one", run={"parallel": "fsdp2"}))
    calls.append(
        asked(
            root / "signalled",
            run={"parallel": "ddp"},
            signal_at=10,
            signal=int(signal.SIGTERM),
        )
    )
    codes = launch(root, calls)
    assert codes == [0, 0], (root / "errors.txt").read_text()[-2000:]
    return root


@pytest.mark.parametrize("mode", MODES)
def test_two_processes_learn_what_one_learns(done, tmp_path, mode: str) -> None:
    one, two = alone(tmp_path), result(done / mode / "whole")
    torch.testing.assert_close(tensors(two), one, rtol=1e-6, atol=1e-6)
    folders = (tmp_path, done / mode / "whole")
    losses = [[row["loss/total"] for row in rows(folder, "step")] for folder in folders]
    assert losses[0] == pytest.approx(losses[1], rel=1e-5)
    measured = json.loads((tmp_path / "result.json").read_text())["measures"]
    assert two["measures"] == pytest.approx(measured, rel=1e-5)


@pytest.mark.parametrize("mode", MODES)
def test_both_processes_end_with_the_same_weights(done, mode: str) -> None:
    first, second = (tensors(result(done / mode / "whole", rank)) for rank in range(2))
    torch.testing.assert_close(first, second, rtol=0, atol=0)


@pytest.mark.parametrize("mode", MODES)
def test_resuming_on_two_is_exact(done, mode: str) -> None:
    whole, parts = result(done / mode / "whole"), result(done / mode / "parts")
    torch.testing.assert_close(tensors(parts), tensors(whole), rtol=0, atol=0)
    assert (parts["outcome"], parts["measures"]) == ("finished", whole["measures"])
    exported = [load_parts(latest(done / mode / run)) for run in ("whole", "parts")]
    torch.testing.assert_close(*exported, rtol=0, atol=0)


@pytest.mark.parametrize("mode", MODES)
def test_one_process_goes_on_where_two_stopped(done, mode: str) -> None:
    rest = alone(done / mode / "to-one")
    torch.testing.assert_close(rest, tensors(result(done / mode / "whole")), rtol=1e-6, atol=1e-6)


def test_two_processes_go_on_where_one_stopped(done, tmp_path) -> None:
    two = tensors(result(done / "from-one"))
    torch.testing.assert_close(two, alone(tmp_path), rtol=1e-6, atol=1e-6)


@pytest.mark.parametrize("mode", MODES)
def test_accumulation_on_two_equals_bigger_micro_batches(done, mode: str) -> None:
    small, whole = result(done / mode / "small"), result(done / mode / "whole")
    torch.testing.assert_close(tensors(small), tensors(whole), rtol=1e-6, atol=1e-6)


@pytest.mark.parametrize("mode", MODES)
def test_half_precision_stays_close_and_equal_on_both(done, mode: str) -> None:
    first, second = (tensors(result(done / mode / "half", rank)) for rank in range(2))
    torch.testing.assert_close(first, second, rtol=0, atol=0)
    whole = tensors(result(done / mode / "whole"))
    torch.testing.assert_close(first, whole, rtol=0.05, atol=0.05)
    assert any(not torch.equal(first[key], whole[key]) for key in whole)


@pytest.mark.parametrize("mode", MODES)
def test_nan_on_one_process_skips_the_step_on_both(done, tmp_path, mode: str) -> None:
    folder = done / mode / "nan"
    first, second = (tensors(result(folder, rank)) for rank in range(2))
    torch.testing.assert_close(first, second, rtol=0, atol=0)
    bad = ToySamples(nan_at=frozenset({11}), unusable=frozenset({2, 7}))
    torch.testing.assert_close(first, alone(tmp_path, bad), rtol=1e-6, atol=1e-6)
    (skip,) = rows(folder, "skip")
    assert (skip["step"], skip["bad_samples"]) == (2, [11])
    progress = state(folder)["progress"]
    assert progress["skips"] == {"loss is not finite": 1}
    assert progress["average_updates"] == {"body": 5, "head": 5}
    # Samples 2 and 7 belong to the second process; the first one counts and logs them.
    assert progress["replaced"] == {"InputError: expected some depth": 2}
    assert [row["sample"] for row in rows(folder, "replaced_sample")] == [2, 7]


def test_a_signal_to_one_process_stops_both_after_the_step(done) -> None:
    found = [result(done / "signalled", rank) for rank in range(2)]
    assert [each["outcome"] for each in found] == ["signalled", "signalled"]
    assert state(done / "signalled")["progress"]["step"] == 3


@pytest.mark.slow
@pytest.mark.parametrize(
    ("mode", "how"),
    [("ddp", "signal_at"), ("fsdp2", "die_while_saving")],
)
def test_a_killed_process_leaves_a_usable_checkpoint(tmp_path, mode: str, how: str) -> None:
    """Sample 18 is taken by the second process at step 4; the fourth checkpoint follows step 3."""
    moment = {"signal_at": 18} if how == "signal_at" else {"die_while_saving": 4}
    codes = launch(tmp_path, [asked(tmp_path / "run", run={"parallel": mode}, **moment)])
    assert codes[1] == -signal.SIGKILL
    assert codes[0] not in (0, -signal.SIGKILL)
    step = 4 if how == "signal_at" else 2
    assert latest(tmp_path / "run").name.endswith(f"step-{step:08d}")
    notes: list[str] = []
    rest = alone(tmp_path / "run", note=notes.append)
    assert f"toy: resumed at step {step}" in notes
    torch.testing.assert_close(rest, alone(tmp_path / "whole"), rtol=1e-6, atol=1e-6)
    assert not list((tmp_path / "run" / "checkpoints").glob(".partial-*"))
