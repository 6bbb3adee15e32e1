"""What a run leaves out, measured: seconds, bytes and error with and without it."""
