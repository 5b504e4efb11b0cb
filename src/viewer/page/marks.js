// Marking by mouse, finger or keys. While a box is drawn the picture stands still, and the tracker keeps that very
// frame, so that the mark is set on what was on the screen, however long it takes.

// Pixels on the screen that a finger may slip in a click, and the least side of a box.
const SLIP = 5;
// Milliseconds that a refusal is shown, and that the tracker may take to say what became of a mark.
const TOLD = 7000;
const PATIENCE = 10000;
// Two boxes are the same if they differ by no more pixels than that.
const SAME = 0.01;
const HINT = "Drag a box around a target.";

export class Marks {
  constructor(picture, link, targets) {
    Object.assign(this, { picture, link, targets });
    this.stage = picture.stage;
    this.bubble = document.getElementById("bubble");
    this.mode = document.getElementById("mode");
    this.freezer = document.getElementById("freeze");
    this.isFrozen = false;
    // The box that is drawn: its corners in the frame, and the pointer that draws it, if it is one.
    this.draft = null;
    // Marks of which is not known yet what becomes of them.
    this.waiting = [];
    this.refused = null;
    // The target that the next box is to be.
    this.renewed = null;
    // Called when a box begins to be drawn.
    this.onDraft = () => {};

    this.stage.addEventListener("pointerdown", (event) => this.down(event));
    this.stage.addEventListener("pointermove", (event) => this.move(event));
    this.stage.addEventListener("pointerup", (event) => this.up(event));
    this.stage.addEventListener("pointercancel", () => this.cancel());
    this.freezer.onclick = () => this.freeze(!this.isFrozen);
    document.addEventListener("keydown", (event) => this.key(event));
    document.addEventListener("visibilitychange", () => this.look());
    picture.addEventListener("shown", () => this.drafts());
  }

  // Whether the picture stands still.
  look() {
    const stands = this.isFrozen || this.draft !== null;
    this.picture.hold(stands);
    this.link.setLooking(!stands && !document.hidden);
  }

  hold() {
    const stamp = this.picture.header?.stamp ?? null;
    this.look();
    return this.link.ask({ hold: { stamp } }).catch((why) => {
      if (this.isFrozen) this.say(`This frame cannot be kept (${why.message}): a mark may come too late for it.`);
    });
  }

  release() {
    if (this.isFrozen || this.draft || this.waiting.length) return;
    this.link.ask({ release: {} }).catch(() => {});
  }

  freeze(isFrozen) {
    if (!this.picture.header) return;
    this.isFrozen = isFrozen;
    this.freezer.setAttribute("aria-pressed", isFrozen);
    this.freezer.textContent = isFrozen ? "Go on" : "Freeze";
    if (isFrozen) {
      this.say("The picture stands still. Drag a box: the mark is set on this frame.");
      this.hold();
    } else {
      this.say();
      this.look();
      this.release();
    }
  }

  say(text) {
    this.mode.textContent = text ?? (this.renewed ? `Drag a box: it becomes target ${this.renewed}.` : HINT);
  }

  // The next box is to be this target.
  renew(id) {
    this.renewed = id;
    this.say();
    this.stage.focus();
  }

  down(event) {
    if (event.button !== 0 || !this.picture.header || this.draft) return;
    this.stage.setPointerCapture(event.pointerId);
    const at = this.picture.point(event);
    this.draft = { from: at, to: at, pointer: event.pointerId, begun: [event.clientX, event.clientY], isClick: true };
    this.hold();
    this.onDraft();
  }

  move(event) {
    const { draft, picture } = this;
    if (!draft) {
      this.stage.classList.toggle("over-target", Boolean(picture.header && picture.targetAt(picture.point(event))));
      return;
    }
    if (draft.pointer !== event.pointerId) return;
    draft.to = picture.point(event);
    const slipped = Math.hypot(event.clientX - draft.begun[0], event.clientY - draft.begun[1]);
    draft.isClick &&= slipped < SLIP;
    this.drafts();
  }

  up(event) {
    const { draft } = this;
    if (draft?.pointer !== event.pointerId) return;
    if (!draft.isClick) return this.mark();
    this.cancel();
    this.targets.pick(this.picture.targetAt(draft.from)?.id ?? null);
  }

  cancel() {
    this.draft = null;
    this.look();
    this.drafts();
    this.release();
  }

  // Sets the mark where the box was drawn, on the frame that is on the screen.
  mark() {
    const rect = area(this.draft);
    const id = this.renewed;
    const { stamp } = this.picture.header;
    const waiting = { rect, kind: "draft" };
    this.waiting.push(waiting);
    this.draft = null;
    this.renewed = null;
    this.refused = null;
    this.bubble.hidden = true;
    this.look();
    this.drafts();
    this.say(this.isFrozen ? "The mark is set on this frame; it is followed when the picture goes on." : undefined);
    this.link.ask({ mark: { rect, id, stamp } }).catch((why) => this.settle(rect, why.message));
    setTimeout(() => {
      if (this.waiting.includes(waiting)) this.settle(rect, "the tracker has not said what became of the mark");
    }, PATIENCE);
  }

  // What became of a mark: a refusal is shown where it was drawn.
  settle(rect, why) {
    const is = (mark) => mark.rect.every((side, i) => Math.abs(side - rect[i]) <= SAME);
    const own = this.waiting.find(is);
    if (!own) return;
    this.waiting = this.waiting.filter((mark) => mark !== own);
    if (why) this.refuse(rect, why);
    this.drafts();
    this.release();
  }

  refuse(rect, why) {
    const refused = { rect, kind: "refused" };
    this.refused = refused;
    const { bubble, picture, stage } = this;
    bubble.textContent = why;
    bubble.hidden = false;
    const [left, top] = [rect[0], rect[1] + rect[3]].map((at) => at / picture.scale);
    bubble.style.left = `${Math.max(4, Math.min(left, stage.clientWidth - bubble.offsetWidth - 4))}px`;
    bubble.style.top = `${Math.max(4, Math.min(top + 6, stage.clientHeight - bubble.offsetHeight - 4))}px`;
    setTimeout(() => {
      if (this.refused !== refused) return;
      this.refused = null;
      bubble.hidden = true;
      this.drafts();
    }, TOLD);
  }

  drafts() {
    const drawn = this.draft && !this.draft.isClick ? [{ rect: area(this.draft), kind: "draft" }] : [];
    this.picture.drafts = [...this.waiting, ...(this.refused ? [this.refused] : []), ...drawn];
    this.picture.draw();
  }

  key(event) {
    if (event.key === "Escape") return this.escape();
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    if (event.target.matches("input, select, textarea")) return;
    const onButton = event.target.matches("button, summary, a");
    const { draft } = this;
    if (event.key === " " && !onButton && !this.freezer.hidden) this.freeze(!this.isFrozen);
    else if (event.key === "Delete" && this.picture.picked !== null) this.targets.stop(this.picture.picked);
    else if (event.key.toLowerCase() === "m") this.box();
    else if (draft?.pointer === null && event.key === "Enter" && !onButton) this.mark();
    else if (draft?.pointer === null && event.key.startsWith("Arrow")) this.nudge(event);
    else return;
    event.preventDefault();
  }

  escape() {
    if (this.draft) this.cancel();
    else if (this.renewed) this.renewed = null;
    else this.targets.pick(null);
    this.bubble.hidden = true;
    this.say(this.isFrozen ? "The picture stands still." : undefined);
  }

  // A box in the middle, which keys move.
  box() {
    if (!this.picture.header || this.draft) return;
    const [w, h] = this.picture.header.size;
    const half = Math.min(w, h) / 10;
    this.draft = { from: [w / 2 - half, h / 2 - half], to: [w / 2 + half, h / 2 + half], pointer: null, isClick: false };
    this.hold();
    this.onDraft();
    this.say("Arrows move the box, with Shift they size it, Enter marks, Escape takes it back.");
    this.stage.focus();
    this.drafts();
  }

  nudge(event) {
    const { draft, picture } = this;
    const step = Math.max(1, Math.round(picture.header.size[0] / 100));
    const axis = event.key === "ArrowLeft" || event.key === "ArrowRight" ? 0 : 1;
    const by = event.key === "ArrowLeft" || event.key === "ArrowUp" ? -step : step;
    const most = picture.header.size[axis];
    const inside = (value) => Math.min(Math.max(value, 0), most);
    if (!event.shiftKey) draft.from[axis] = inside(draft.from[axis] + by);
    draft.to[axis] = inside(draft.to[axis] + by);
    this.drafts();
  }
}

// Left, top, width and height of the box between two corners.
function area({ from: [x0, y0], to: [x1, y1] }) {
  return [Math.min(x0, x1), Math.min(y0, y1), Math.abs(x1 - x0), Math.abs(y1 - y0)];
}
