import subprocess
import sys

import pytest

from diff4splat.errors import InputError
from diff4splat.models.text_encoder.prompt import require_prompt


@pytest.mark.parametrize("prompt", ["a", "猫が走る", "🦊" * 3, "two\nlines", " spaced "])
def test_usable_prompts_come_back_unchanged(prompt: str) -> None:
    assert require_prompt(prompt, 64) == prompt


@pytest.mark.parametrize("prompt", ["", " ", "\n\t "])
def test_empty_prompt_is_refused(prompt: str) -> None:
    with pytest.raises(InputError, match="expected some text, got none; leave the prompt out"):
        require_prompt(prompt, 64)


def test_length_is_counted_in_bytes() -> None:
    assert require_prompt("é" * 4, 8) == "éééé"
    with pytest.raises(InputError, match="at most 8 bytes of UTF-8, got 10; shorten it by 2"):
        require_prompt("é" * 5, 8)


def test_lone_surrogate_is_refused() -> None:
    with pytest.raises(InputError, match="damaged character at position 1"):
        require_prompt("a\udc80", 64)


def test_messages_have_one_line() -> None:
    with pytest.raises(InputError) as caught:
        require_prompt("line\n" * 100, 8)
    assert "\n" not in str(caught.value)


def test_no_torch_is_imported() -> None:
    code = "import sys, diff4splat.models.text_encoder.prompt; sys.exit('torch' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0
