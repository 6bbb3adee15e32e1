"""CogVideoX folders: what is wrong is said before any weight is written; the vocabulary."""

import json
import shutil
from collections.abc import Callable
from pathlib import Path

import cogvideox_folder
import pytest
from imported_cogvideox import SETTINGS, cogvideox_source
from safetensors.torch import load_file, save_file

from diff4splat.errors import CheckpointError, FileFormatError
from diff4splat.models.cogvideox.key_map import joint_dit_key
from diff4splat.models.public_weights.import_model import open_public_model, write_model
from diff4splat.models.public_weights.sentencepiece import PIECES_FILE, tokenizer_json
from diff4splat.models.wan.tokenizer import TOKENIZER_FILE, Tokenizer

__all__ = ["cogvideox_source"]

SENTENCES = ["the red car moves to the left", "a blue boat, blurry and far away", "cars move left"]


@pytest.fixture
def folder(cogvideox_source: Path, tmp_path: Path) -> Path:
    """A copy to spoil."""
    return shutil.copytree(cogvideox_source, tmp_path / "source")


def edit(file: Path, **values: object) -> None:
    file.write_text(json.dumps(json.loads(file.read_text()) | values))


def edited(name: str, **values: object) -> Callable[[Path], None]:
    return lambda folder: edit(folder / name, **values)


def shard(folder: Path) -> Path:
    return sorted((folder / "transformer").glob("*.safetensors"))[1]


def without_a_weight(folder: Path) -> None:
    tensors = load_file(shard(folder))
    save_file(dict(sorted(tensors.items())[1:]), shard(folder))


def half_of_a_shard(folder: Path) -> None:
    content = shard(folder).read_bytes()
    shard(folder).write_bytes(content[: len(content) // 2])


def link_outside(folder: Path) -> None:
    name, target = shard(folder).name, folder.parent / "elsewhere.safetensors"
    shutil.move(shard(folder), target)
    (folder / "transformer" / name).symlink_to(target)


TRANSFORMER, SCHEDULER = "transformer/config.json", "scheduler/scheduler_config.json"
BAD: dict[str, tuple[Callable[[Path], None], str]] = {
    "another transformer": (
        edited(TRANSFORMER, _class_name="WanTransformer3DModel"),
        r"expected the architecture CogVideoXTransformer3DModel, got 'WanTransformer3DModel'",
    ),
    "another prediction": (
        edited(SCHEDULER, prediction_type="epsilon"),
        r"expected prediction_type to be v_prediction, got epsilon",
    ),
    "other betas": (edited(SCHEDULER, trained_betas=[0.1]), r"expected trained_betas to be None"),
    "no scheduler": (lambda f: shutil.rmtree(f / "scheduler"), r"scheduler_config\.json: expected"),
    "learned without rotary": (
        edited(TRANSFORMER, use_learned_positional_embeddings=True),
        r"expected use_learned_positional_embeddings to be false without rotary",
    ),
    "frames per token": (edited(TRANSFORMER, patch_size_t=3), r"expected patch_size_t to be none"),
    "channels": (edited(TRANSFORMER, in_channels=7), r"expected in_channels to be 4 or 8, got 7"),
    "mixed models": (edited("text_encoder/config.json", d_model=32), r"the folder mixes models"),
    "groups": (edited("vae/config.json", norm_num_groups=3), r"expected block_out_channels"),
    "quantiser": (edited("vae/config.json", use_quant_conv=True), r"use_quant_conv to be False"),
    "a scale that is none": (edited("vae/config.json", scaling_factor=0), r"scaling_factor"),
    "no vocabulary": (lambda f: shutil.rmtree(f / "tokenizer"), r"spiece\.model: expected a file"),
    "a missing weight": (without_a_weight, r"missing 1 \("),
    "a shard cut off": (half_of_a_shard, r"the file is cut off"),
    "a link that leads out": (link_outside, r"got a link to"),
}


@pytest.mark.parametrize("case", BAD)
def test_bad_folders_are_refused_in_words(case: str, folder: Path, tmp_path: Path) -> None:
    change, words = BAD[case]
    change(folder)
    with pytest.raises((CheckpointError, FileFormatError), match=words):
        write_model(open_public_model(folder, SETTINGS), tmp_path / "out")
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("kind", cogvideox_folder.KINDS)
def test_every_public_weight_has_a_name_of_its_own(kind: str) -> None:
    public = cogvideox_folder.transformer(kind).state_dict()
    assert len({joint_dit_key(key) for key in public}) == len(public)


@pytest.fixture
def pieces(tmp_path: Path) -> Path:
    """A vocabulary as SentencePiece itself trains it, with T5's special pieces."""
    library = pytest.importorskip("sentencepiece", reason="needs the package sentencepiece")
    library.SentencePieceTrainer.train(
        sentence_iterator=iter(SENTENCES * 20),
        model_prefix=str(tmp_path / "spiece"),
        vocab_size=60,
        hard_vocab_limit=False,
        model_type="unigram",
        pad_id=0,
        eos_id=1,
        unk_id=2,
        bos_id=-1,
        minloglevel=2,
        num_threads=1,
    )
    return tmp_path / PIECES_FILE


PROMPTS = ["", "the red car", "  Two  spaces,\nand a line", "ﬁne Ａ &amp; ü", "move " * 30]


@pytest.mark.parametrize("prompt", PROMPTS)
def test_tokens_are_those_of_sentencepiece(pieces: Path, tmp_path: Path, prompt: str) -> None:
    import sentencepiece

    (tmp_path / TOKENIZER_FILE).write_bytes(tokenizer_json(pieces))
    ours = Tokenizer(tmp_path / TOKENIZER_FILE, 500, cleans=False)
    theirs = sentencepiece.SentencePieceProcessor(model_file=str(pieces))
    assert ours.token_row(prompt) == [*theirs.encode(prompt), theirs.eos_id()]


def test_a_folder_may_hold_pieces_alone(folder: Path, pieces: Path, tmp_path: Path) -> None:
    (folder / "tokenizer" / TOKENIZER_FILE).unlink()
    shutil.move(pieces, folder / "tokenizer" / PIECES_FILE)
    write_model(open_public_model(folder, SETTINGS), tmp_path / "out")
    assert Tokenizer(tmp_path / "out" / TOKENIZER_FILE, 11).token_row("the red car")[-1] == 1


@pytest.mark.parametrize("content", [b"\x00", b"\x0a\xff\x01", b"\x0a\x02\x0a\x00", b"text" * 50])
def test_damaged_pieces_are_refused(content: bytes, tmp_path: Path) -> None:
    (tmp_path / PIECES_FILE).write_bytes(content)
    with pytest.raises(FileFormatError, match="SentencePiece"):
        tokenizer_json(tmp_path / PIECES_FILE)
