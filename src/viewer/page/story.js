// The last minutes: a strip of figures, and events.

// Milliseconds that the strip shows, and events that are listed.
const SPAN = 180000;
const EVENTS = 60;
const STATES = ["tracking", "uncertain", "lost"];
// What a response is held against, in the order of a sample's figures.
const THRESHOLDS = ["certain", "lost", "found"];
const PALETTE = ["--accent", "--warn", "--good", "--lost"];
// Targets that have lanes and lines of their own.
const MOST_TARGETS = 4;
// Milliseconds without a frame that are a gap.
const GAP = 1500;

export class Story {
  constructor() {
    this.samples = [];
    // Of a recording: the figures of the run before, the frame that is shown, and how many there are.
    this.previous = [];
    this.place = null;
    this.onPick = () => {};
    this.canvas = document.getElementById("strip");
    this.list = document.getElementById("events");
    this.legend = document.getElementById("legend");
    this.offset = 0;
    this.isDue = false;
    new ResizeObserver(() => this.plan()).observe(this.canvas);
    this.canvas.onclick = ({ offsetX }) => {
      if (this.place) this.onPick(Math.floor((offsetX / this.canvas.clientWidth) * this.place.frames));
    };
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => this.plan());
  }

  // Begins anew, with the tracker's clock at `now`.
  begin(now) {
    this.samples = [];
    this.previous = [];
    this.list.replaceChildren();
    this.clock(now);
  }

  clock(now) {
    this.offset = performance.now() - now;
  }

  // Another run through a recording begins.
  beginRun(previous) {
    this.previous = previous;
    this.samples = [];
  }

  // A target was called otherwise from a time on: it keeps its lane.
  rename(id, to, from) {
    for (const [at, , , targets] of this.samples) {
      if (at > from && !this.place) break;
      for (const target of targets) if (target[0] === id) target[0] = to;
    }
    this.plan();
  }

  // A recording is shown, at this frame of so many: the strip is all of it.
  replay(frame, frames) {
    this.place = { frame, frames };
    this.canvas.style.cursor = "pointer";
    this.plan();
  }

  // The tracker's clock.
  get now() {
    return performance.now() - this.offset;
  }

  add(samples) {
    this.samples.push(...samples);
    const first = this.place ? 0 : this.samples.findIndex(([at]) => at > this.now - SPAN - GAP);
    if (first > 0) this.samples.splice(0, first);
    this.plan();
  }

  plan() {
    if (this.isDue) return;
    this.isDue = true;
    requestAnimationFrame(() => {
      this.isDue = false;
      this.draw();
    });
  }

  // Ids in the order in which they appear, those of the newest frames in front.
  ids() {
    const ids = new Set();
    for (let i = this.samples.length - 1; i >= 0 && ids.size < MOST_TARGETS; i--) {
      for (const [id] of this.samples[i][3]) if (ids.size < MOST_TARGETS) ids.add(id);
    }
    return [...ids].sort();
  }

  draw() {
    const { canvas, samples } = this;
    const ratio = devicePixelRatio;
    const [width, height] = [canvas.clientWidth, canvas.clientHeight];
    canvas.width = width * ratio;
    canvas.height = height * ratio;
    const pen = canvas.getContext("2d");
    pen.scale(ratio, ratio);
    const style = getComputedStyle(document.documentElement);
    const colour = (name) => style.getPropertyValue(name);
    pen.font = "11px system-ui, sans-serif";
    const ids = this.ids();
    const { place } = this;
    const end = place?.frames ?? Math.max(this.now, samples.at(-1)?.[0] ?? 0);
    // The strip grows until it is as long as it may be.
    const span = place?.frames ?? Math.min(SPAN, Math.max(end - (samples[0]?.[0] ?? end), 20000));
    const x = (at) => width - ((end - at) / span) * width;
    // Time without a sample that is a gap, and for how long the last one stands.
    this.gap = place ? 1.5 : GAP;
    this.lasts = place ? 1 : 40;

    const bands = (this.previous.length ? 17 : 12) * Math.max(ids.length, 1);
    // Three lanes with their headings, and the line of times.
    const lane = (height - bands - 3 * 15 - 3 * 3 - 16) / 3;
    let top = 0;
    const heading = (text) => {
      pen.fillStyle = colour("--soft");
      pen.fillText(text, 0, top + 11);
      top += 15;
    };
    ids.forEach((id, row) => this.states(pen, this.samples, id, x, top + 12 * row, 9, colour));
    // Those of the run before, thinner.
    const below = top + 12 * ids.length;
    ids.forEach((id, row) => this.states(pen, this.previous, id, x, below + 5 * row, 4, colour));
    top += bands + 2;
    const grid = (low, high) => {
      pen.strokeStyle = colour("--grid");
      for (const y of [low, high]) line(pen, [[0, y], [width, y]]);
    };

    heading("confidence");
    const scaled = (bottom, tall, most) => (value) => bottom - (Math.min(value, most) / most) * tall;
    grid(top, top + lane);
    this.lines(pen, ids, 2, x, scaled(top + lane, lane, 1), colour);
    top += lane + 3;

    const held = samples.findLast((s) => s[3][0]?.[4])?.[3][0][4];
    const named = held?.map((value, i) => `${THRESHOLDS[i]} ${value.toFixed(2)}`).join(" · ");
    heading(named ? `response; dashed: ${named}` : "response");
    const highest = samples.reduce((most, s) => Math.max(most, ...s[3].flatMap((t) => [t[3], ...(t[4] ?? [])])), 0.1);
    grid(top, top + lane);
    const level = scaled(top + lane, lane, highest);
    this.thresholds(pen, ids, x, level, colour);
    this.lines(pen, ids, 3, x, level, colour);
    top += lane + 3;

    const slowest = samples.map((s) => s[2]).sort((a, b) => a - b)[Math.floor(0.99 * samples.length)] ?? 0;
    const longest = Math.max(20, slowest);
    heading(place ? `time a frame took (to ${longest.toFixed(0)} ms)` : `latency (to ${longest.toFixed(0)} ms) and skipped frames`);
    grid(top, top + lane);
    pen.strokeStyle = colour("--soft");
    const late = scaled(top + lane, lane, longest);
    line(pen, samples.map(([at, , latency]) => [x(at), late(latency)]), this.gap, samples);
    pen.fillStyle = colour("--lost");
    const most = Math.max(4, ...samples.map((s) => s[1]));
    for (const [at, skipped] of samples) {
      if (skipped) pen.fillRect(x(at) - 1, top + lane - (skipped / most) * lane, 2, (skipped / most) * lane);
    }
    pen.fillStyle = colour("--soft");
    const [from, to] = place ? ["frame 1", `${place.frames}`] : [`${Math.round(span / 1000)} s ago`, "now"];
    pen.fillText(from, 0, height - 2);
    pen.fillText(to, width - pen.measureText(to).width, height - 2);
    if (place) {
      pen.fillStyle = colour("--accent");
      pen.fillRect(x(place.frame + 0.5) - 1, 0, 2, height - 14);
    }
    this.explain(ids, colour);
  }

  states(pen, samples, id, x, top, tall, colour) {
    for (let i = 0; i < samples.length; i++) {
      const [at, , , targets] = samples[i];
      const target = targets.find((t) => t[0] === id);
      if (!target) continue;
      const until = Math.min(samples[i + 1]?.[0] ?? at + this.lasts, at + this.gap);
      pen.fillStyle = colour(["--tracking", "--uncertain", "--gone"][target[1]]);
      pen.fillRect(x(at), top, Math.max(x(until) - x(at), 1) + 0.3, tall);
    }
  }

  // What responses are held against, of several targets in their colours.
  thresholds(pen, ids, x, y, colour) {
    pen.setLineDash([5, 4]);
    ids.forEach((id, i) => {
      pen.strokeStyle = colour(ids.length > 1 ? PALETTE[i] : "--soft");
      const known = this.samples.flatMap((s) => s[3].filter((t) => t[0] === id && t[4]).map((t) => [s[0], t[4]]));
      THRESHOLDS.forEach((_, which) => {
        line(pen, known.map(([at, values]) => [x(at), y(values[which])]), this.gap, known);
      });
    });
    pen.setLineDash([]);
  }

  lines(pen, ids, field, x, y, colour) {
    pen.lineWidth = 1.5;
    // The run before is fainter, behind.
    for (const [samples, strength] of [[this.previous, 0.4], [this.samples, 1]]) {
      pen.globalAlpha = strength;
      ids.forEach((id, i) => {
        pen.strokeStyle = colour(PALETTE[i]);
        const known = samples.filter(([, , , targets]) => targets.some((t) => t[0] === id));
        const value = ([, , , targets]) => targets.find((t) => t[0] === id)[field];
        line(pen, known.map((sample) => [x(sample[0]), y(value(sample))]), this.gap, known);
      });
    }
    pen.globalAlpha = 1;
    pen.lineWidth = 1;
  }

  explain(ids, colour) {
    const key = [...ids, colour("--accent")].join("\n");
    if (this.explained === key) return;
    this.explained = key;
    const item = (text, shade) => {
      const li = document.createElement("li");
      const swatch = document.createElement("i");
      swatch.style.background = shade;
      li.append(swatch, text);
      return li;
    };
    const lines = ids.map((id, i) => item(`target ${id}`, `var(${PALETTE[i]})`));
    const states = ["--tracking", "--uncertain", "--gone"].map((name, i) => item(STATES[i], `var(${name})`));
    this.legend.replaceChildren(...lines, ...states, ...(this.place ? [] : [item("skipped", "var(--lost)")]));
  }

  // A new event, the newest on top.
  tell({ at, kind, id, text, picture }) {
    const li = document.createElement("li");
    const time = document.createElement("time");
    time.textContent = new Date(Date.now() - (this.now - at)).toLocaleTimeString();
    li.append(time);
    if (picture) {
      const img = document.createElement("img");
      img.src = `data:image/jpeg;base64,${picture}`;
      img.alt = `target ${id} at that moment`;
      li.append(img);
    }
    const words = document.createElement("span");
    const what = document.createElement("b");
    what.className = kind;
    what.textContent = { lost: "lost", found: "found again", marked: "marked", refused: "mark refused", stopped: "stopped", renamed: "renamed", set: "set" }[kind] ?? kind;
    const rest = {
      refused: `: ${text}`, stopped: id === null ? ": all targets" : ` target ${id}`,
      renamed: ` target ${id}: now ${text}`, set: ` ${id} to ${text}`,
    }[kind] ?? ` target ${id}`;
    words.append(what, rest);
    li.append(words);
    this.list.prepend(li);
    while (this.list.childElementCount > EVENTS) this.list.lastChild.remove();
  }
}

// A line through the points, broken where the samples have a gap.
function line(pen, points, gap, samples) {
  pen.beginPath();
  points.forEach(([x, y], i) => {
    const isBroken = i === 0 || (gap && samples[i][0] - samples[i - 1][0] > gap);
    if (isBroken) pen.moveTo(x, y);
    else pen.lineTo(x, y);
  });
  pen.stroke();
}
