// A pinhole camera in OpenCV axes that orbits a point; its lens fits the scene's image into the window.
const NEAR = 0.01;

class OrbitCamera {
  constructor(header, focusDepth) {
    Object.assign(this, { header, focusDepth });
    this.set(pathCamera(header, header.path.times_s[0]));
  }

  set({ rows, position, focal, center }) {
    Object.assign(this, { rows, position, focalPx: focal, centerPx: center });
    this.distance = this.focusDepth;
    this.home ??= { rows, position, focal, center };
  }

  get focus() { return add(this.position, scaled(column(this.rows, 2), this.distance)); }

  // Intrinsics in pixels of the canvas.
  lens(size) {
    const [height, width] = this.header.size_px, fit = Math.min(size[0] / width, size[1] / height);
    return {
      focal: scaled([...this.focalPx, 0], fit).slice(0, 2),
      center: [size[0] / 2 + (this.centerPx[0] - width / 2) * fit, size[1] / 2 + (this.centerPx[1] - height / 2) * fit],
    };
  }

  view(size) { return { rows: this.rows, position: this.position, ...this.lens(size) }; }

  orbit(right, down) {
    const { focus } = this, up = column(this.home.rows, 1);
    const spin = (v, axis, angle) => turned(v, axis, angle);
    const sideways = column(this.rows, 0);
    const columns = [0, 1, 2].map((i) => spin(spin(column(this.rows, i), sideways, -down), up, right));
    this.rows = orthonormal(fromColumns(...columns));
    this.position = subtract(focus, scaled(column(this.rows, 2), this.distance));
  }

  pan(right, down) {
    const step = add(scaled(column(this.rows, 0), -right), scaled(column(this.rows, 1), -down));
    this.position = add(this.position, scaled(step, this.distance / this.focalPx[0]));
  }

  zoom(factor) {
    const { focus } = this;
    this.distance = clamp(this.distance * factor, 1e-3 * this.focusDepth, 1e3 * this.focusDepth);
    this.position = subtract(focus, scaled(column(this.rows, 2), this.distance));
  }

  fly([right, down, forward]) {
    this.position = add(this.position, apply(this.rows, scaled([right, down, forward], this.focusDepth)));
  }
}

// The scene's own path at a time: positions and lenses blend, rotations are made orthonormal again.
function pathCamera(header, timeS) {
  const { times_s: times, world_from_camera: poses, focal_px: focals, center_px: centers } = header.path;
  let low = 0;
  while (low < times.length - 2 && times[low + 1] <= timeS) low++;
  const high = Math.min(low + 1, times.length - 1), gap = times[high] - times[low];
  const w = gap > 0 ? clamp((timeS - times[low]) / gap, 0, 1) : 0, pose = mix(poses[low], poses[high], w);
  const rows = orthonormal([0, 4, 8].map((i) => pose.slice(i, i + 3)));
  return {
    rows, position: [pose[3], pose[7], pose[11]],
    focal: mix(focals[low], focals[high], w), center: mix(centers[low], centers[high], w),
  };
}
