"""Text that could steer a terminal is shown, not obeyed."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from diff4splat.cli.common.console import fail, note
from diff4splat.errors import InputError
from diff4splat.progress.plain_text import REPLACEMENT, plain_text

HOSTILE = "a\x1b[31mb\x07c\x9bd\u202ee\x00f\x7f"
SHOWN = "a?[31mb?c?d?e?f?".replace("?", REPLACEMENT)


def test_control_characters_become_a_visible_sign() -> None:
    assert plain_text(HOSTILE) == SHOWN
    assert plain_text("a\nb\tc\rd\u2028e") == f"a b c d{REPLACEMENT}e"
    assert plain_text("é 猫 \U0001f697 \u200d [bold]") == "é 猫 \U0001f697 \u200d [bold]"


@given(st.text())
def test_nothing_hidden_is_left_and_nothing_is_lost(text: str) -> None:
    plain = plain_text(text)
    assert len(plain) == len(text)
    assert plain_text(plain) == plain
    assert plain.isprintable() or all(c.isprintable() or ord(c) > 0x9F for c in plain)


def test_notes_and_errors_cannot_steer_the_terminal(capsys: pytest.CaptureFixture) -> None:
    note(f"Prompt: {HOSTILE}")
    fail(InputError(f"prompt: got {HOSTILE}"))
    shown = capsys.readouterr().err
    assert "\x1b[31mb" not in shown
    assert shown.count(SHOWN) == 2
