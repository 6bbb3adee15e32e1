import copy
import json
from importlib import resources

import pytest

from diff4splat.data_prep.synthetic.motions.registry import families_for
from diff4splat.data_prep.synthetic.splits import Allowed, known_names, load_split, parse_split
from diff4splat.errors import ConfigError


@pytest.fixture(name="content")
def _content() -> dict:
    file = resources.files("diff4splat.data_prep.synthetic.splits") / "v1.json"
    return json.loads(file.read_text(encoding="utf-8"))


def test_training_never_sees_what_is_held_out(content: dict) -> None:
    training, held_out = load_split("training"), load_split("held_out")
    for key in known_names():
        seen: Allowed = getattr(training, key)
        other: Allowed = getattr(held_out, key)
        assert other.new and not set(seen.names) & other.new
        assert set(seen.names) | other.new == set(other.names)
        assert not seen.new


def test_every_training_motion_has_somebody_to_do_it() -> None:
    split = load_split("training")
    for motion in split.motions.names:
        assert set(families_for(motion)) & set(split.families.names), motion


def test_broken_files_are_refused(content: dict) -> None:
    cases = []
    for change, words in (
        (lambda c: c.update(version=2), "expected version 1"),
        (lambda c: c["families"]["training"].append("unicorn"), "unicorn"),
        (lambda c: c["motions"]["held_out"].clear(), "missing"),
        (lambda c: c["textures"]["held_out"].append(c["textures"]["training"][0]), "once"),
    ):
        broken = copy.deepcopy(content)
        change(broken)
        cases.append((broken, words))
    for broken, words in cases:
        with pytest.raises(ConfigError, match=words):
            parse_split(broken, "training")
    with pytest.raises(ConfigError, match="training or held_out"):
        parse_split(content, "test")


def test_narrowing_to_known_names_only() -> None:
    families = load_split("held_out").families
    assert families.only(("ball", "gear"), "families").new == {"gear"}
    with pytest.raises(ConfigError, match="unicorn"):
        families.only(("unicorn",), "families")
    with pytest.raises(ConfigError, match="gear"):
        load_split("training").families.only(("gear",), "families")
