// Order of the Gaussians from back to front, in a worker. The key is the float bits of z, which rise
// with z and are finest near the camera, so that one far outlier costs no precision.
function sorterMain() {
  const BINS = 1 << 18;
  let means, offsets, step, moving, count;
  const counts = new Uint32Array(BINS + 1);

  function depths(request) {
    const { axis, position, layers, weights } = request, z = new Float32Array(count);
    const shift = axis[0] * position[0] + axis[1] * position[1] + axis[2] * position[2];
    for (let i = 0, j = 0; i < count; i++, j += 3) {
      z[i] = axis[0] * means[j] + axis[1] * means[j + 1] + axis[2] * means[j + 2] - shift;
    }
    for (let part = 0; part < 4 && moving; part++) {
      const weight = weights[part] * step, start = layers[part] * moving * 3;
      if (!weight) continue;
      for (let i = 0, j = start; i < moving; i++, j += 3) {
        z[i] += weight * (axis[0] * offsets[j] + axis[1] * offsets[j + 1] + axis[2] * offsets[j + 2]);
      }
    }
    return z;
  }

  function order(z, near) {
    const bits = new Uint32Array(z.buffer);
    let low = 0xffffffff, high = 0, shown = 0;
    for (let i = 0; i < count; i++) {
      if (!(z[i] > near)) continue;
      shown++;
      if (bits[i] < low) low = bits[i];
      if (bits[i] > high) high = bits[i];
    }
    let shift = 0;
    while (shown && (high - low) >>> shift >= BINS) shift++;
    counts.fill(0);
    for (let i = 0; i < count; i++) if (z[i] > near) counts[((high - bits[i]) >>> shift) + 1]++;
    for (let bin = 0; bin < BINS; bin++) counts[bin + 1] += counts[bin];
    const sorted = new Uint32Array(shown);
    // Equal depths by falling index: the renderer draws the first of them in front.
    for (let i = count - 1; i >= 0; i--) if (z[i] > near) sorted[counts[(high - bits[i]) >>> shift]++] = i;
    return sorted;
  }

  onmessage = ({ data }) => {
    if (data.means) {
      ({ means, offsets, step, moving, count } = data);
      return;
    }
    const started = performance.now(), sorted = order(depths(data), data.near);
    postMessage({ sorted, number: data.number, milliseconds: performance.now() - started }, [sorted.buffer]);
  };
}

// The worker starts at once, so that it is there when the scene has been read.
class Sorter {
  constructor(header, onSorted) {
    const url = URL.createObjectURL(new Blob([`(${sorterMain})()`], { type: "text/javascript" }));
    Object.assign(this, { header, worker: new Worker(url) });
    this.worker.onmessage = ({ data }) => onSorted(data);
  }

  load({ means, offsets }) {
    const { offset_step: step, moving, count } = this.header;
    this.worker.postMessage({ means, offsets, step, moving, count });
  }

  sort(request) { this.worker.postMessage(request); }
}
