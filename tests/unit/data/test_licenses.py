"""Licences that allow selling what was learned, alone and joined."""

import pytest

from diff4splat.data.licenses import commercial_ok


@pytest.mark.parametrize(
    ("name", "ok"),
    [
        ("MIT", True),
        (" cc by_4.0 ", True),
        ("CC-BY-NC-4.0", False),
        ("", False),
        ("CC0-1.0 AND CC-BY-3.0", True),
        ("CC0-1.0 and cc-by-3.0", True),
        ("CC0-1.0 AND CC-BY-NC-4.0", False),
        ("CC-BY-NC-4.0 AND MIT", False),
        ("MIT OR CC-BY-NC-4.0", False),
        ("MITANDMIT", False),
    ],
)
def test_all_joined_licences_must_allow_it(name: str, ok: bool) -> None:
    assert commercial_ok(name) is ok
