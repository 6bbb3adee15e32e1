// What the camera does, as nerfstudio's camera_path.json: OpenGL axes, vertical field of view in degrees.
const RECORD_FPS = 24;

class Recorder {
  constructor(header) { Object.assign(this, { header, frames: null, nextS: 0 }); }

  get isRecording() { return this.frames !== null; }

  start() { Object.assign(this, { frames: [], nextS: 0, elapsedS: 0, before: null }); }

  // A slow screen shows fewer frames than are recorded: those between are blended.
  add(seconds, camera, timeS, size) {
    if (!this.isRecording) return;
    const now = { rows: camera.rows, position: camera.position, focal: camera.lens(size).focal, timeS };
    const before = this.before ?? now, endS = this.elapsedS + seconds;
    for (; this.nextS <= endS; this.nextS += 1 / RECORD_FPS) {
      const w = seconds > 0 ? (this.nextS - this.elapsedS) / seconds : 1;
      this.frames.push(nerfstudioFrame(between(before, now, w), this.header, size));
    }
    Object.assign(this, { before: now, elapsedS: endS });
  }

  stop(size) {
    const { frames, header } = this, [start, stop] = header.time_range_s;
    this.frames = null;
    // A time that does not rise all the way is none: the path then plays at its own rate.
    const rises = frames.every((frame, i) => !i || frame.render_time > frames[i - 1].render_time);
    if (!rises) for (const frame of frames) delete frame.render_time;
    return {
      camera_type: "perspective", render_height: size[1], render_width: size[0], fps: RECORD_FPS,
      // Shares of time are of the whole scene, also where a part of it was recorded.
      seconds: rises && stop > start ? stop - start : frames.length / RECORD_FPS,
      is_cycle: false, smoothness_value: 0, keyframes: [], camera_path: frames,
    };
  }
}

function between(before, now, w) {
  return {
    rows: orthonormal(before.rows.map((row, i) => mix(row, now.rows[i], w))),
    position: mix(before.position, now.position, w),
    focal: mix(before.focal, now.focal, w),
    timeS: before.timeS + (now.timeS - before.timeS) * w,
  };
}

function nerfstudioFrame({ rows, position, focal, timeS }, header, size) {
  const [start, stop] = header.time_range_s;
  const pose = rows.map((row, i) => [row[0], -row[1], -row[2], position[i]]);
  return {
    camera_to_world: [...pose.flat(), 0, 0, 0, 1],
    fov: 2 * Math.atan(size[1] / (2 * focal[1])) * 180 / Math.PI,
    aspect: size[0] / size[1],
    render_time: stop > start ? (timeS - start) / (stop - start) : 0,
  };
}

function download(name, value) {
  const link = document.createElement("a");
  link.href = URL.createObjectURL(new Blob([JSON.stringify(value)], { type: "application/json" }));
  link.download = name;
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 1000);
}
