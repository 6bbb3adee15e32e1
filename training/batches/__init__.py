"""From clips to batches: which clip, which frames, which targets, in tensors of one shape."""
