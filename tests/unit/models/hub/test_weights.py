import json
from pathlib import Path

import pytest
import torch
from safetensors.torch import load_file, save_file

from diff4splat.errors import CheckpointError, ConfigError, FileFormatError, OutputError
from diff4splat.models.config.sizes import test_size as tiny_size
from diff4splat.models.factory import create_networks
from diff4splat.models.hub.weight_files import load_config, part_file, weights_sha256
from diff4splat.models.hub.weights import load_networks, save_networks
from diff4splat.models.networks import Networks


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    save_networks(create_networks(tiny_size(), seed=5), tiny_size(), tmp_path / "model")
    return tmp_path / "model"


def load(folder: Path, parts: tuple[str, ...] | None = None) -> Networks:
    return load_networks(folder, load_config(folder), parts)


def rewrite(folder: Path, part: str, change: dict[str, torch.Tensor | None]) -> None:
    tensors = load_file(part_file(folder, part)) | change
    save_file(
        {key: value for key, value in tensors.items() if value is not None}, part_file(folder, part)
    )


def test_weights_are_as_readable_as_the_configuration(folder: Path) -> None:
    modes = {file.stat().st_mode for file in folder.iterdir()}
    assert len(modes) == 1


@pytest.mark.parametrize("parts", [None, ("dit",), ("ldrm", "vae"), ()])
def test_round_trip_is_exact(folder: Path, parts: tuple[str, ...] | None) -> None:
    assert load_config(folder) == tiny_size()
    networks = load(folder, parts)
    want = create_networks(tiny_size(), seed=5, parts=parts)
    for (name, part), (other, reference) in zip(networks.parts(), want.parts(), strict=True):
        assert name == other
        for key, value in reference.state_dict().items():
            assert torch.equal(part.state_dict()[key], value), key


def test_loaded_networks_can_be_trained_and_run(folder: Path) -> None:
    networks = load(folder)
    out = networks.ldrm(torch.randn(1, 4, 1, 2, 2), torch.randn(1, 6, 1, 16, 16)).gaussians
    out.sum().backward()
    assert networks.ldrm.to_gaussians.bias.grad.any()


def test_statistics_travel_with_the_weights(tmp_path: Path) -> None:
    networks = create_networks(tiny_size())
    networks.vae.set_statistics(torch.arange(4.0), torch.full((4,), 2.0))
    save_networks(networks, tiny_size(), tmp_path)
    loaded = load(tmp_path)
    assert torch.equal(loaded.vae.latent_mean, torch.arange(4.0))


@pytest.mark.parametrize("dtype", [torch.float16, torch.bfloat16])
def test_half_precision_on_disk_is_float32_in_memory(tmp_path: Path, dtype: torch.dtype) -> None:
    networks = create_networks(tiny_size())
    save_networks(networks, tiny_size(), tmp_path, dtype)
    assert {t.dtype for t in load_file(part_file(tmp_path, "dit")).values()} == {dtype}
    loaded = load(tmp_path)
    for key, value in networks.dit.state_dict().items():
        assert loaded.dit.state_dict()[key].dtype == torch.float32
        assert torch.equal(loaded.dit.state_dict()[key], value.to(dtype).float())


def test_hash_sees_weights_and_nothing_else(folder: Path) -> None:
    before = weights_sha256(folder)
    assert len(before) == 64 and before == weights_sha256(folder)
    (folder / "notes.txt").write_text("hello")
    assert weights_sha256(folder) == before
    rewrite(folder, "ldrm", {"to_gaussians.bias": torch.full((12,), 1e-3)})
    assert weights_sha256(folder) != before


def test_hash_sees_which_part_a_file_is(folder: Path) -> None:
    before = weights_sha256(folder)
    part_file(folder, "vae").rename(folder / "x")
    part_file(folder, "ldrm").rename(part_file(folder, "vae"))
    (folder / "x").rename(part_file(folder, "ldrm"))
    assert weights_sha256(folder) != before


def test_missing_keys_are_counted_and_three_are_named(folder: Path) -> None:
    keys = [f"blocks.{i}.attention.to_{what}.bias" for i in (0, 1) for what in ("query", "key")]
    rewrite(folder, "ldrm", dict.fromkeys(keys))
    with pytest.raises(
        CheckpointError, match=r"ldrm weights: missing 4 \(.*, .*, .*, …\)"
    ) as caught:
        load(folder)
    assert sum(key in str(caught.value) for key in keys) == 3


def test_unexpected_keys_are_named(folder: Path) -> None:
    rewrite(folder, "vae", {"extra": torch.zeros(1)})
    with pytest.raises(CheckpointError, match=r"vae weights: unexpected 1 \(extra\)"):
        load(folder)


def test_wrong_shapes_are_named(folder: Path) -> None:
    rewrite(folder, "dit", {"head.bias": torch.zeros(3)})
    with pytest.raises(
        CheckpointError, match=r"wrong shape of 1 \(head.bias \(3,\) instead of \(16,\)\)"
    ):
        load(folder)


def test_a_part_that_may_lack_is_random(folder: Path) -> None:
    part_file(folder, "dit").unlink()
    networks = load_networks(folder, tiny_size(), ("dit", "vae"), may_lack=("dit", "vae"))
    want = create_networks(tiny_size(), seed=0).dit, create_networks(tiny_size(), seed=5).vae
    for part, reference in zip((networks.dit, networks.vae), want, strict=True):
        for key, value in reference.state_dict().items():
            assert torch.equal(part.state_dict()[key], value), key


@pytest.mark.parametrize("damage", ["nan", "cut", "missing key", "gone"])
def test_only_the_files_of_asked_parts_matter(folder: Path, damage: str) -> None:
    file = part_file(folder, "ldrm")
    if damage == "nan":
        rewrite(folder, "ldrm", {"merge.bias": torch.full((24,), float("nan"))})
    elif damage == "missing key":
        rewrite(folder, "ldrm", {"merge.bias": None})
    else:
        file.write_bytes(file.read_bytes()[:-9]) if damage == "cut" else file.unlink()
    assert load(folder, ("vae", "dit")).ldrm is None
    with pytest.raises((CheckpointError, FileFormatError), match="ldrm"):
        load(folder, ("vae", "ldrm"))


def test_the_hash_of_some_parts_sees_those_alone(folder: Path) -> None:
    before = weights_sha256(folder, ("vae",)), weights_sha256(folder, ("ldrm", "vae"))
    assert weights_sha256(folder, ("vae", "ldrm")) == before[1] != before[0]
    rewrite(folder, "ldrm", {"to_gaussians.bias": torch.full((12,), 1e-3)})
    assert weights_sha256(folder, ("vae",)) == before[0]
    assert weights_sha256(folder, ("ldrm", "vae")) != before[1]


def test_absent_part_is_named(folder: Path) -> None:
    part_file(folder, "text_encoder").unlink()
    assert load(folder, ("vae", "dit")).text_encoder is None
    with pytest.raises(CheckpointError, match=r"text_encoder\.safetensors: expected a weight file"):
        load(folder)


def test_a_folder_without_a_model(tmp_path: Path) -> None:
    with pytest.raises(CheckpointError, match=r"expected a model folder with config\.json"):
        load_config(tmp_path)
    with pytest.raises(CheckpointError, match="expected a model folder"):
        load(tmp_path / "nowhere")


@pytest.mark.parametrize("damage", ["empty", "cut", "noise", "pickle"])
def test_damaged_files_are_refused(folder: Path, damage: str) -> None:
    file = part_file(folder, "vae")
    whole = file.read_bytes()
    if damage == "pickle":
        torch.save({"x": torch.zeros(1)}, file)
    else:
        file.write_bytes(
            {"empty": b"", "cut": whole[: len(whole) // 2], "noise": bytes(range(256)) * 9}[damage]
        )
    with pytest.raises(FileFormatError, match="expected safetensors, got a damaged file"):
        load(folder)


def test_unknown_setting_in_the_configuration(folder: Path) -> None:
    data = json.loads((folder / "config.json").read_text()) | {"colour": 1}
    (folder / "config.json").write_text(json.dumps(data))
    with pytest.raises(ConfigError, match="got 'colour'"):
        load(folder)


def test_configuration_that_is_not_text(folder: Path) -> None:
    (folder / "config.json").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(FileFormatError, match="text in UTF-8"):
        load_config(folder)


@pytest.mark.parametrize("value", [float("nan"), float("inf"), 1e30])
def test_weights_that_the_dtype_cannot_hold_are_refused(tmp_path: Path, value: float) -> None:
    networks = create_networks(tiny_size())
    with torch.no_grad():
        networks.vae.encoder.conv_in.conv.bias[0] = value
    with pytest.raises(
        CheckpointError, match=r"expected finite numbers in encoder\.conv_in\.conv\.bias"
    ):
        save_networks(networks, tiny_size(), tmp_path, torch.float16)
    assert not (tmp_path / "config.json").exists()


def test_a_file_in_the_way(tmp_path: Path) -> None:
    (tmp_path / "model").write_text("")
    with pytest.raises(OutputError, match="a file stands where a folder is needed"):
        save_networks(create_networks(tiny_size()), tiny_size(), tmp_path / "model")
