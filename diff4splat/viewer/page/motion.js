// Key times to four layers and weights of offsets, and two layers of rotations (docs/reference/scene-format.md).
function blendAt(header, timeS) {
  const times = header.key_times_s;
  if (!header.moving || times.length === 1) {
    return { layers: [0, 0, 0, 0], weights: [header.moving ? 1 : 0, 0, 0, 0], between: [0, 0], weight: 0 };
  }
  const last = times.length - 1;
  let low = 0;
  while (low < last - 1 && times[low + 1] <= timeS) low++;
  const gap = times[low + 1] - times[low], w = clamp((timeS - times[low]) / gap, 0, 1);
  const between = [low, low + 1];
  if (header.interpolation !== "cubic" || last < 2) {
    return { layers: [low, low + 1, low, low], weights: [1 - w, w, 0, 0], between, weight: w };
  }
  return { ...hermite(times, low, w, gap), between, weight: w };
}

// A cubic Hermite curve with central-difference tangents is a weighted sum of four keys.
function hermite(times, low, w, gap) {
  const last = times.length - 1, before = Math.max(low - 1, 0), after = Math.min(low + 2, last);
  const w2 = w * w, w3 = w2 * w;
  const first = (w3 - 2 * w2 + w) * gap / (times[low + 1] - times[before]);
  const second = (w3 - w2) * gap / (times[after] - times[low]);
  return {
    layers: [low, low + 1, before, after],
    weights: [2 * w3 - 3 * w2 + 1 - second, 3 * w2 - 2 * w3 + first, -first, second],
  };
}
