"""Worlds that several tests look at; making one with every annotation checked takes a while."""

from functools import cache

from diff4splat.data_prep.synthetic.world import World
from diff4splat.data_prep.synthetic.worlds import WorldRecipe, make_world

SPLITS = ("training", "held_out")
COUNT = 8
"""Of each split; nobody changes them."""


@cache
def made_world(split: str, index: int) -> World:
    """World number ``index`` of the default recipe."""
    return make_world(WorldRecipe(split=split), index)
