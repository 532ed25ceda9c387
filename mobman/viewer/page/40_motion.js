const TRACKS = ["t", "q", "q_dot", "tip", "desired", "error", "platform", "effort"];

// A run's samples, and where it is between them.
class Motion {
  constructor(description) {
    for (const name of TRACKS) this[name] = unpack(description[name]);
    // where it will go, for a run that has only begun
    this.path = unpack(description.path) || this.desired;
    this.measure();
  }

  measure() {
    this.frames = this.t.length;
    this.end = this.t[this.frames - 1];
    if (this.effort) this.peaks = columnPeaks(this.effort);
  }

  // Later samples of the same run.
  extend(later) {
    for (const name of TRACKS) {
      const [now, more] = [this[name], later[name]];
      if (!now || !more) continue;
      const both = new now.constructor(now.length + more.length);
      both.set(now);
      both.set(more, now.length);
      this[name] = Object.assign(both, { columns: now.columns, rows: now.rows + more.rows });
    }
    this.measure();
  }

  // The last frame at or before a time, and how far it is to the next, 0 to 1.
  at(time) {
    let low = 0, high = this.frames - 1;
    if (time >= this.t[high]) return { frame: high, share: 0 };
    if (time <= this.t[0]) return { frame: 0, share: 0 };
    while (high - low > 1) {
      const middle = (low + high) >> 1;
      if (this.t[middle] <= time) low = middle;
      else high = middle;
    }
    return { frame: low, share: (time - this.t[low]) / (this.t[high] - this.t[low]) };
  }

  // Along the cubic that has the recorded configurations and rates at both frames.
  configuration({ frame, share }, q) {
    const n = this.q.columns;
    const a = frame * n;
    if (share === 0) {
      for (let i = 0; i < n; i++) q[i] = this.q[a + i];
      return q;
    }
    const b = a + n;
    const h = this.t[frame + 1] - this.t[frame];
    const s = share, r = 1 - share;
    for (let i = 0; i < n; i++)
      q[i] = r * r * (1 + 2 * s) * this.q[a + i] + s * s * (3 - 2 * s) * this.q[b + i] +
        h * s * r * (r * this.q_dot[a + i] - s * this.q_dot[b + i]);
    return q;
  }

  point(array, { frame, share }, result) {
    const next = Math.min(frame + 1, this.frames - 1);
    return result.set(...[0, 1, 2].map((i) => (1 - share) * array[3 * frame + i] + share * array[3 * next + i]));
  }
}

function columnPeaks(matrix) {
  const peaks = new Float64Array(matrix.columns);
  for (let i = 0; i < matrix.length; i++) {
    const size = Math.abs(matrix[i]);
    if (Number.isFinite(size) && size > peaks[i % matrix.columns]) peaks[i % matrix.columns] = size;
  }
  return peaks;
}
