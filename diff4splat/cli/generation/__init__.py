"""What ``diff4splat generate`` does once its options are checked."""
