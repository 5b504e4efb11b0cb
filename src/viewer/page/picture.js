// The picture and what is drawn on it. Boxes are in pixels of the frame: the drawing has the frame's size as its view
// box, and lies over the picture whatever the size of either.

const SVG = "http://www.w3.org/2000/svg";
// Milliseconds that a trail goes back, and seconds that a velocity is drawn for.
const TRAIL = 3000;
const AHEAD = 0.5;
// Pixels on the screen of captions.
const CAPTION = 13;
// Viridis (Smith and van der Walt, released as CC0) at eight equal steps.
const VIRIDIS = [
  [68, 1, 84], [71, 45, 123], [59, 82, 139], [44, 114, 142], [33, 145, 140],
  [40, 174, 128], [94, 201, 98], [173, 220, 48], [253, 231, 37],
];
// What can be hidden: name, words, colour, and whether it is shown at first.
const LAYERS = [
  ["names", "names", null, true], ["trail", "trail", null, true], ["velocity", "velocity", null, false],
  ["window", "search window", "#5aaaff", true], ["prediction", "prediction", "#fff", false],
  ["neighbour", "neighbours", "#aa78ff", true], ["proposal", "proposals", "#f05af0", true],
  ["particle", "particles", "#00e6ff", true],
];
const KEPT = "long_term_tracker layers";

// The parts of a message: length | header | JPEG | maps.
export function parse(data) {
  const length = new DataView(data).getUint32(0, true);
  const header = JSON.parse(new TextDecoder().decode(new Uint8Array(data, 4, length)));
  let at = 4 + length;
  const jpeg = new Blob([new Uint8Array(data, at, header.jpeg)], { type: "image/jpeg" });
  at += header.jpeg;
  for (const map of header.maps) {
    map.cells = new Uint8Array(data, at, map.rows * map.cols);
    at += map.rows * map.cols;
  }
  return { header, jpeg };
}

export class Picture extends EventTarget {
  constructor(stage) {
    super();
    this.stage = stage;
    this.canvas = stage.querySelector("canvas");
    this.overlay = stage.querySelector("svg");
    this.context = this.canvas.getContext("2d", { alpha: false });
    this.small = document.createElement("canvas");
    // What is on the screen, and whether it stays there.
    this.header = null;
    this.image = null;
    this.isHeld = false;
    // The newest message that came while it was.
    this.missed = null;
    this.newest = 0;
    this.trails = new Map();
    this.picked = null;
    this.drafts = [];
    this.layers = { response: 0, ...Object.fromEntries(LAYERS.map(([name, , , shown]) => [name, shown])) };
    try {
      Object.assign(this.layers, JSON.parse(localStorage.getItem(KEPT)));
    } catch { /* What was kept cannot be read: the layers are as at first. */ }
    new ResizeObserver(() => this.draw()).observe(stage);
  }

  // Pixels that a picture should have.
  get side() {
    const { width, height } = this.canvas;
    const across = this.stage.clientWidth * devicePixelRatio;
    return Math.min(Math.max(across, (across * height) / width, 160), 3840);
  }

  // Takes a message, and shows it unless the picture is held or a newer one is there.
  async take(data) {
    if (this.isHeld) {
      this.missed = data;
      return;
    }
    const { header, jpeg } = parse(data);
    this.follow(header);
    const image = await createImageBitmap(jpeg);
    if (this.isHeld) this.missed = data;
    if (this.isHeld || header.number <= this.newest) return image.close();
    this.newest = header.number;
    this.image?.close();
    this.image = image;
    this.header = header;
    this.draw();
    this.dispatchEvent(new Event("shown"));
  }

  // Stands still, or shows what it has missed.
  hold(isHeld) {
    this.isHeld = isHeld;
    const { missed } = this;
    if (isHeld || !missed) return;
    this.missed = null;
    this.take(missed);
  }

  // A new connection counts its frames anew.
  forget() {
    this.newest = 0;
    this.missed = null;
    this.trails.clear();
  }

  follow(header) {
    for (const { id, rect, state } of header.targets) {
      const [x, y, w, h] = rect;
      const trail = this.trails.get(id) ?? [];
      trail.push([header.at, x + w / 2, y + h / 2, state]);
      while (trail[0][0] < header.at - TRAIL) trail.shift();
      this.trails.set(id, trail);
    }
    for (const [id, trail] of this.trails) if (trail.at(-1)[0] < header.at - TRAIL) this.trails.delete(id);
  }

  // Pixels of the frame to a pixel of the page.
  get scale() {
    return this.header ? this.header.size[0] / this.stage.clientWidth : 1;
  }

  // The point of the frame under the pointer, kept inside the frame.
  point(event) {
    const { left, top, width, height } = this.canvas.getBoundingClientRect();
    const [w, h] = this.header?.size ?? [width, height];
    const inside = (value, most) => Math.min(Math.max(value, 0), most);
    return [inside(((event.clientX - left) * w) / width, w), inside(((event.clientY - top) * h) / height, h)];
  }

  // The smallest target whose box holds the point, a little around it included.
  targetAt([x, y]) {
    const slack = 4 * this.scale;
    const holds = ({ rect: [l, t, w, h] }) =>
      x >= l - slack && x <= l + w + slack && y >= t - slack && y <= t + h + slack;
    const area = ({ rect }) => rect[2] * rect[3];
    return (this.header?.targets ?? []).filter(holds).sort((a, b) => area(a) - area(b))[0];
  }

  draw() {
    const { header, image } = this;
    // A stage without a width, as there is while the page is laid out, has no scale.
    if (!header || !this.stage.clientWidth) return;
    const [width, height] = header.size;
    // The canvas has the pixels of the picture; the browser stretches it.
    if (this.canvas.width !== image.width || this.canvas.height !== image.height) {
      this.canvas.width = image.width;
      this.canvas.height = image.height;
    }
    this.context.globalAlpha = 1;
    this.context.drawImage(image, 0, 0);
    if (this.layers.response > 0) for (const map of header.maps) this.paint(map, image.width / width);
    this.overlay.setAttribute("viewBox", `0 0 ${width} ${height}`);
    this.overlay.dataset.stamp = header.stamp ?? "";
    this.overlay.replaceChildren(...this.shapes(header));
  }

  paint({ rows, cols, cells, window: [x, y, w, h] }, zoom) {
    const { small, context } = this;
    small.width = cols;
    small.height = rows;
    const pixels = new ImageData(cols, rows);
    cells.forEach((value, i) => {
      const at = (value / 255) * (VIRIDIS.length - 1);
      const low = Math.min(Math.floor(at), VIRIDIS.length - 2);
      const mixed = VIRIDIS[low].map((c, k) => c + (at - low) * (VIRIDIS[low + 1][k] - c));
      pixels.data.set([...mixed, 255], 4 * i);
    });
    small.getContext("2d").putImageData(pixels, 0, 0);
    context.globalAlpha = this.layers.response;
    context.drawImage(small, x * zoom, y * zoom, w * zoom, h * zoom);
    context.globalAlpha = 1;
  }

  *shapes(header) {
    const { layers } = this;
    const boxes = { window: header.windows, prediction: header.predictions, neighbour: header.neighbours, proposal: header.proposals };
    for (const [name, rects] of Object.entries(boxes)) if (layers[name]) for (const rect of rects) yield box(rect, name);
    if (layers.particle && header.particles.length) {
      yield shape("path", { class: "particle", d: header.particles.map(([x, y]) => `M${x} ${y}h0`).join("") });
    }
    if (layers.window) for (const [name, [x, y]] of header.modes) yield this.text(name, x, y, "");
    for (const target of header.targets) yield* this.target(target);
    for (const { rect, kind } of this.drafts) {
      yield box(rect, "shadow");
      yield box(rect, kind);
    }
  }

  *target({ id, rect, velocity, state, confidence, reacquired }) {
    const [x, y, w, h] = rect;
    const [cx, cy] = [x + w / 2, y + h / 2];
    const trail = this.trails.get(id);
    if (this.layers.trail && trail?.length > 1) {
      yield shape("polyline", { class: `trail ${state}`, points: trail.map(([, px, py]) => `${px},${py}`).join(" ") });
    }
    if (this.layers.velocity) {
      const [dx, dy] = velocity.map((v) => v * AHEAD);
      yield shape("path", { class: `velocity ${state}`, d: `M${cx} ${cy}l${dx} ${dy}` });
    }
    const shown = box(rect, `box ${state}${id === this.picked ? " picked" : ""}`);
    shown.dataset.id = id;
    yield shown;
    if (this.layers.names) {
      const words = `${id} · ${state === "tracking" ? "" : `${state} `}${confidence.toFixed(2)}${reacquired ? " found" : ""}`;
      yield this.text(words, x, y, state);
    }
  }

  text(words, x, y, state) {
    const size = CAPTION * this.scale;
    const below = y < 1.6 * size;
    const text = shape("text", { class: `caption ${state}-text`, x, y: below ? y + size : y - 0.4 * size, "font-size": size });
    text.textContent = words;
    return text;
  }

  // Check boxes for what is drawn, and a slider for how much of the response covers the picture.
  controls(bar) {
    const keep = () => {
      localStorage.setItem(KEPT, JSON.stringify(this.layers));
      this.draw();
    };
    for (const [name, words, colour] of LAYERS) {
      const label = document.createElement("label");
      const input = Object.assign(document.createElement("input"), { type: "checkbox", checked: this.layers[name] });
      input.dataset.layer = name;
      input.onchange = () => {
        this.layers[name] = input.checked;
        keep();
      };
      label.append(input);
      if (colour) {
        const swatch = document.createElement("i");
        swatch.style.background = colour;
        label.append(swatch);
      }
      label.append(words);
      bar.append(label);
    }
    const label = document.createElement("label");
    const slider = Object.assign(document.createElement("input"), { type: "range", min: 0, max: 1, step: 0.05, value: this.layers.response });
    slider.oninput = () => {
      this.layers.response = Number(slider.value);
      keep();
    };
    label.append("response", slider);
    bar.append(label);
  }
}

function shape(name, attributes) {
  const element = document.createElementNS(SVG, name);
  for (const [key, value] of Object.entries(attributes)) element.setAttribute(key, value);
  return element;
}

function box([x, y, width, height], kind) {
  return shape("rect", { class: kind, x, y, width, height });
}
