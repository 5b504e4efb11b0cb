// The way to the tracker: one WebSocket, opened again when it breaks.
//
// Events: "hello", "news" and "picture" with what came as detail, "open", "closed", "refused" with the reason.

// Pictures that may be on their way: one is drawn while the next travels.
const AHEAD = 2;
// Milliseconds until the next try, after the first and after many.
const SOONEST = 500;
const LATEST = 5000;
const TOKEN = "long_term_tracker token";

export class Link extends EventTarget {
  constructor() {
    super();
    this.asked = new Map();
    this.number = 0;
    this.wait = SOONEST;
    this.looks = 0;
    this.side = 640;
    this.isLooking = true;
    // The link in the log ends in #TOKEN, which browsers keep to themselves.
    const given = location.hash.slice(1);
    if (given) {
      sessionStorage.setItem(TOKEN, given);
      history.replaceState(null, "", location.pathname);
    }
  }

  open() {
    const socket = new WebSocket(`${location.protocol === "https:" ? "wss" : "ws"}://${location.host}/live`);
    socket.binaryType = "arraybuffer";
    this.socket = socket;
    this.isIn = false;
    let isRefused = false;
    socket.onopen = () => this.send({ enter: { token: sessionStorage.getItem(TOKEN) ?? "" } });
    socket.onmessage = ({ data }) => {
      if (typeof data !== "string") {
        this.looks -= 1;
        this.tell("picture", data);
        this.look();
        return;
      }
      const [[kind, value]] = Object.entries(JSON.parse(data));
      if (kind === "answer") this.answer(value);
      else if (kind === "refused") {
        isRefused = value.asks_token;
        this.tell("refused", value);
      } else {
        if (kind === "hello") {
          this.isIn = true;
          this.wait = SOONEST;
          this.looks = 0;
          this.look();
        }
        this.tell(kind, value);
      }
    };
    socket.onclose = () => {
      this.isIn = false;
      for (const { refuse } of this.asked.values()) refuse(new Error("the connection broke"));
      this.asked.clear();
      this.tell("closed");
      if (isRefused) return;
      setTimeout(() => this.open(), this.wait);
      this.wait = Math.min(2 * this.wait, LATEST);
    };
  }

  // Tries again with a token that the user gave.
  enter(token) {
    sessionStorage.setItem(TOKEN, token);
    this.open();
  }

  tell(kind, detail) {
    this.dispatchEvent(new CustomEvent(kind, { detail }));
  }

  send(message) {
    if (this.socket?.readyState === WebSocket.OPEN) this.socket.send(JSON.stringify(message));
  }

  // Asks for the next pictures, unless enough are asked for or nobody looks.
  look() {
    while (this.isIn && this.isLooking && this.looks < AHEAD) {
      this.looks += 1;
      this.send({ look: { side: Math.round(this.side) } });
    }
  }

  setLooking(isLooking) {
    this.isLooking = isLooking;
    this.look();
  }

  // Asks for something to be done; fails with the reason if it is not.
  ask(command) {
    if (!this.isIn) return Promise.reject(new Error("not connected"));
    this.number += 1;
    const { number } = this;
    this.send({ ask: { number, command } });
    return new Promise((done, refuse) => this.asked.set(number, { done, refuse }));
  }

  answer({ number, error, file }) {
    const waiting = this.asked.get(number);
    this.asked.delete(number);
    if (error === null) waiting?.done(file);
    else waiting?.refuse(new Error(error));
  }
}
