"""The members of one clip in a shard: how each is written and read."""
