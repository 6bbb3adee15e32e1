"""``diff4splat models``: public models as ours."""
